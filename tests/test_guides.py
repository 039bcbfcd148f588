"""The guides' commands, run as they stand there, but for fewer tasks and shorter trainings."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from commands import EVAPS

ROOT = Path(__file__).parents[1]
SMALLER = {
    "--tasks 20000": "--tasks 20 --workers 0",
    "evaps train mean": "evaps train mean --scale smoke --workers 0",
    "--methods mean lgrl": "--methods mean lgrl --tasks 1 --workers 0",
    "--tasks 1000": "--tasks 1 --workers 0",
}

pytestmark = pytest.mark.slow


def blocks(page: str, language: str) -> list[str]:
    """The code blocks of a page."""
    text = (ROOT / "docs" / page).read_text()
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def install(folder: Path, toml: str, *modules: str) -> Path:
    """`pip install .` of a package like the guide's into a folder of its own; that folder."""
    package, site = folder / "package", folder / "site"
    package.mkdir()
    (package / "pyproject.toml").write_text(toml)
    for module in modules:
        shutil.copy(ROOT / "examples" / module, package)
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation"]
    done = subprocess.run([*pip, "--target", site, package], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return site


def follow(commands: str, folder: Path, site: Path, **variables: str) -> str:
    """Run a page's commands in a shell; what they print."""
    for old, new in SMALLER.items():
        commands = commands.replace(old, new)
    path = f"{EVAPS.parent}:{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "PYTHONPATH": str(site), **variables}
    shell = ["bash", "-euo", "pipefail", "-c", commands]
    done = subprocess.run(shell, cwd=folder, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_method_of_ones_own_is_trained_judged_and_reported(tmp_path: Path) -> None:
    """And the page about evaluation, with the data that this one makes."""
    site = install(tmp_path, *blocks("own-method.md", "toml"), "own_method.py")
    told = "".join(follow(block, tmp_path, site) for block in blocks("own-method.md", "sh"))
    assert "| mean | " in told
    assert "mean" in (tmp_path / "report" / "table-1.md").read_text()
    shutil.rmtree(tmp_path / "rows")
    told = "".join(follow(block, tmp_path, site) for block in blocks("evaluation.md", "bash"))
    assert "| LGRL | " in told
    assert (tmp_path / "report" / "complexity.svg").exists()


def test_a_package_with_a_domain_is_installed_and_found(tmp_path: Path) -> None:
    """What comes after that is tried in test_domains.py."""
    site = install(tmp_path, *blocks("own-robot.md", "toml"), "own_domain.py", "own_world.py")
    (tmp_path / "clean.py").write_text(blocks("own-robot.md", "")[0])
    told = follow("evaps export --program clean.py", tmp_path, site, EVAPS_DOMAIN="vacuum")
    assert "suck" in told


def test_the_robots_page_shows_how_to_act() -> None:
    (code,) = blocks("robot.md", "python")
    exec(compile(code, "robot.md", "exec"), found := {})
    assert found["info"]
    assert not found["terminated"]
