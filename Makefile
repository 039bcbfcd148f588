# `make demo` and `make test` each set up a fresh machine and then do their job; `make help` lists the rest.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
TORCH := $(shell grep '^torch==' constraints.txt)
ARGS ?=
SCALE ?= small

.DEFAULT_GOAL := help
.PHONY: help demo test paper site lint format clean
.DELETE_ON_ERROR:

help:  ## list the targets
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 16

demo: $(VENV)/.core  ## synthesize programs for the shipped tasks and write a page about it (ARGS="...")
	$(BIN)/evaps demo $(ARGS)

# Every pytest worker is a process of its own, so one thread each is what two cores can bear.
test: lint  ## style, types and the whole suite (ARGS="-k beam" for a part)
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest $(ARGS)

paper: $(VENV)/.dev  ## the paper's evaluation: every table and figure (SCALE=smoke|quick|small|paper)
	$(BIN)/python -m recipes.paper --scale $(SCALE) $(ARGS)

site: $(VENV)/.dev  ## the documentation as a site, in site/
	$(BIN)/mkdocs build

lint: $(VENV)/.dev  ## style and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(VENV)/.dev  ## mend the style
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:  ## remove .venv, caches and builds; data/, runs/ and out/ stay
	rm -rf $(VENV) build dist site .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find src tests recipes examples -name __pycache__ -type d -prune -exec rm -rf {} + 2>/dev/null || true

# --- set-up: each stamp is newer than what it was made from, so a second run has nothing to do ---

$(VENV)/.made:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "evaps needs Python 3.11 or newer: apt-get install python3 python3-venv, or make PYTHON=/path/to/python3.11" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
	  { echo "Python has no venv module: apt-get install python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv --clear $(VENV)
	@touch $@

# torch first and by its pinned version: left to the resolver, it may bring gigabytes of CUDA.
$(VENV)/.core: $(VENV)/.made pyproject.toml constraints.txt
	@echo "Installing evaps and what it needs into $(VENV) (a few minutes the first time)"
	@$(PIP) install -c constraints.txt '$(TORCH)'
	@$(PIP) install -c constraints.txt -e .
	@$(BIN)/python -m evaps.libraries
	@touch $@

$(VENV)/.dev: $(VENV)/.core
	@$(PIP) install -c constraints.txt -e '.[dev]'
	@touch $@
