"""The README's figures are what its rows say, and what it names exists."""

import re
import shlex
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from commands import check_commands

from evaps.metrics import Results
from evaps.report.answers import answer_table
from evaps.report.summary import bench_table, seeds_table
from recipes import verified
from recipes.paper import LARGER, Plan, noise_page, readme_table, scale_table

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


@pytest.fixture(scope="module")
def results() -> Results:
    return Results.read(ROOT / "results" / "small" / "methods")


def test_the_figures_are_those_of_the_committed_rows(results: Results) -> None:
    shown = README.split("<!-- results/small/methods -->")[1].split("<!-- end -->")[0]
    assert shown.strip() == readme_table(results)


def test_the_figures_of_the_benchmark_are_those_of_the_committed_rows() -> None:
    page = (ROOT / "docs" / "performance.md").read_text()
    shown = page.split("<!-- results/bench.jsonl -->")[1].split("<!-- end -->")[0]
    assert shown.strip() == bench_table(ROOT / "results" / "bench.jsonl")


def test_the_figures_of_verified_synthesis_are_those_of_the_committed_rows(results: Results) -> None:
    found = Results.read(verified.ROWS)
    page = (ROOT / "docs" / "verified.md").read_text()
    shown = page.split("<!-- verified -->")[1].split("<!-- end -->")[0]
    assert shown.strip() == verified.tables(results, found)
    shown = README.split("<!-- answers -->")[1].split("<!-- end -->")[0]
    assert shown.strip() == answer_table(results, found)


def test_the_figures_about_noise_are_those_of_the_committed_rows() -> None:
    page = (ROOT / "docs" / "findings.md").read_text()
    shown = page.split("<!-- noise -->")[1].split("<!-- end -->")[0]
    assert shown.strip() == noise_page(ROOT / "results" / "small")


def test_the_figures_of_the_larger_scale_are_those_of_the_committed_rows() -> None:
    page = (ROOT / "docs" / "findings.md").read_text()
    shown = page.split("<!-- scales -->")[1].split("<!-- end -->")[0]
    assert shown.strip() == scale_table(Plan(root=ROOT), replace(LARGER, root=ROOT))


def test_the_figures_of_each_seed_are_those_of_the_committed_rows(results: Results) -> None:
    page = (ROOT / "docs" / "findings.md").read_text()
    shown = page.split("<!-- seeds -->")[1].split("<!-- end -->")[0]
    assert shown.strip() == seeds_table(results)


def test_every_command_it_shows_exists() -> None:
    assert check_commands(README) >= 6


@pytest.mark.parametrize("path", re.findall(r"\]\(((?!http)[^)]+)\)", README))
def test_every_link_leads_somewhere(path: str) -> None:
    assert (ROOT / path).exists()


def test_the_python_example_runs(tmp_path: Path) -> None:
    code = re.search(r"```python\n(import evaps\n.*?)```", README, re.DOTALL)
    assert code is not None
    ran = subprocess.run([sys.executable, "-c", code[1]], capture_output=True, text=True, cwd=ROOT)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.startswith("DEF run m(")
    assert shlex.split(ran.stdout.splitlines()[-1])[0] in ("True", "False")
