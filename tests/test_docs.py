"""The site can be built, strictly; what its pages show works."""

from __future__ import annotations

import os
import pydoc
import re
import subprocess
import sys
from pathlib import Path

import pytest
from commands import EVAPS, check_commands

from evaps.dsl import Program
from recipes.site import command_names, on_page_markdown

ROOT = Path(__file__).parents[1]
PAGES = sorted((ROOT / "docs").glob("*.md"))


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    mkdocs = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", folder]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(mkdocs, cwd=ROOT, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_every_page_is_in_the_site(site: Path) -> None:
    for page in PAGES:
        folder = "" if page.stem == "index" else page.stem
        assert (site / folder / "index.html").exists(), page


def test_the_command_line_has_a_section_for_each_command(site: Path) -> None:
    text = (site / "cli" / "index.html").read_text()
    assert len(command_names()) > 10
    assert all(f"evaps {name}</h2>" in re.sub(r"<a [^>]*>.*?</a>", "", text) for name in command_names())


def test_links_to_files_outside_of_the_site_become_names() -> None:
    assert on_page_markdown("see [examples/a.py](../examples/a.py)") == "see `examples/a.py`"
    assert on_page_markdown("[rows](../results/r)") == "rows (`results/r` in the repository)"
    assert on_page_markdown("[here](robot.md)") == "[here](robot.md)"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_command_and_option_in_a_page_exists(page: Path) -> None:
    check_commands(page.read_text())


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_name_of_the_code_in_a_page_is_there(page: Path) -> None:
    for name in re.findall(r"`(evaps(?:\.\w+)+)`", page.read_text()):
        assert pydoc.locate(name) is not None, name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_program_in_a_page_is_one(page: Path) -> None:
    for code in re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL):
        if code.startswith("def run():"):
            assert Program.parse(code)


def test_the_shell_completes_as_the_page_says(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "cli.md").read_text()
    (block,) = re.findall(r"```bash\n(.*?)```", page, re.DOTALL)
    home = {**os.environ, "HOME": str(tmp_path), "PATH": f"{EVAPS.parent}:{os.environ['PATH']}"}
    asked = f"{block}\nsource ~/.local/share/bash-completion/completions/evaps; complete -p evaps"
    done = subprocess.run(["bash", "-ec", asked], capture_output=True, text=True, env=home)
    assert done.returncode == 0, done.stderr
    assert "evaps" in done.stdout


def test_what_the_shell_shows_of_an_option_is_one_line(tmp_path: Path) -> None:
    """It would take a second line for another option."""
    script = tmp_path / "evaps"
    subprocess.run([EVAPS, "--tyro-write-completion", "bash", script], check=True)
    asked = (
        f"source {script}; complete -p evaps; COMP_WORDS=(evaps synthesize --); COMP_CWORD=2; _tyro_evaps; "
        'printf "%s\\n" "${COMPREPLY[@]}"'
    )
    told = subprocess.run(["bash", "-c", asked], capture_output=True, text=True, check=True).stdout
    options = told.splitlines()[1:]
    assert "--method" in options
    assert all(option.startswith("-") for option in options)
    specification = re.search(r"^COMPLETION_SPEC = (.*)$", script.read_text(), re.MULTILINE)
    assert specification is not None
    assert "\\n" not in specification[1]


@pytest.mark.slow
def test_the_first_page_can_be_followed(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "index.md").read_text()
    program, python = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    scene, five = re.findall(r"```json\n(.*?)```", page, re.DOTALL)
    (tmp_path / "program.py").write_text(program)
    (tmp_path / "scene.json").write_text(scene)
    (tmp_path / "five.json").write_text(five)
    commands = [line for line in page.splitlines() if re.match(r"evaps (run|make-task|synthesize) ", line)]
    for command in commands:
        words = [EVAPS, *command.split()[1:]]
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    assert len(commands) == 3
    assert (tmp_path / "run.gif").exists()
    assert (tmp_path / "page.html").exists()
    done = subprocess.run([sys.executable, "-c", python], cwd=ROOT, capture_output=True, text=True)
    assert done.stdout.rstrip().endswith("True"), done.stderr
