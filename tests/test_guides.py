"""The guides' commands, run as they stand there, but for fewer tasks and shorter trainings."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from commands import EVAPS

from evaps.models import SHIPPED
from evaps.robots.base import Scene
from evaps.robots.scenes import validate

ROOT = Path(__file__).parents[1]
NOT_HERE = ("evaps studio", "evaps bench")
"""The one does not end, the other takes minutes; both have tests of their own."""

ROWS = ROOT / "results" / "small" / "methods" / "rewards"
SMALLER = {
    "--tasks 20000": "--tasks 20 --workers 0",
    "--tasks 1000\n": "--tasks 1 --workers 0\n",
    "--tasks 100000": "--tasks 20",
    "--tasks 2000 --seed 0": "--tasks 60 --seed 0 --workers 0",
    "--tasks 5\n": "--tasks 1 --workers 0 --actions 200\n",
    "--methods mean lgrl": "--methods mean lgrl --tasks 1 --workers 0",
    "--methods lgrl evaps": "--methods lgrl evaps --tasks 1 --workers 0",
    "--out rows.parquet": "--out rows.parquet --tasks 1 --methods lgrl",
    "--workers 64 --address HEAD:6379": "--workers 1",
    "evaps train mean": "evaps train mean --scale smoke --workers 0",
    "evaps train lgrl --data data/small": "evaps train lgrl --scale smoke --workers 0 --data data/small",
    "evaps train evaps": "evaps train evaps --scale smoke --workers 0",
    "--tasks 3000 --seed 0": "--tasks 60 --seed 0 --workers 0",
    "--scale quick\n": "--scale smoke --workers 0\n",
    "--tasks 40\n": "--tasks 1 --workers 0 --actions 200\n",
    "evaps train encoder --data data/small": "evaps train encoder --scale smoke --data data/small",
    "--scale smoke\n": "--scale smoke --workers 0\n",
    "report all --rows results/small/methods": f"report differences --rows {ROWS}",
}
"""What stands in the pages, and what is run instead."""

pytestmark = pytest.mark.slow
# the classes are there so that workers can share these tests


def blocks(page: str, language: str) -> list[str]:
    """The code blocks of a page of the documentation, or of ../README.md."""
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
    commands = "\n".join(line for line in commands.splitlines() if not line.startswith(NOT_HERE)) + "\n"
    for old, new in SMALLER.items():
        commands = commands.replace(old, new)
    path = f"{EVAPS.parent}:{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "PYTHONPATH": str(site), **variables}
    shell = ["bash", "-euo", "pipefail", "-c", commands]
    done = subprocess.run(shell, cwd=folder, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    return done.stdout


class TestOwnMethod:
    def test_a_method_of_ones_own_is_trained_judged_and_reported(self, tmp_path: Path) -> None:
        """And the page about evaluation, with the data that this one makes."""
        site = install(tmp_path, *blocks("own-method.md", "toml"), "own_method.py")
        told = "".join(follow(block, tmp_path, site) for block in blocks("own-method.md", "sh"))
        assert "| mean | " in told
        assert "mean" in (tmp_path / "report" / "table-1.md").read_text()
        shutil.rmtree(tmp_path / "rows")
        told = "".join(follow(block, tmp_path, site) for block in blocks("evaluation.md", "bash"))
        assert "| LGRL | " in told
        assert (tmp_path / "report" / "complexity.svg").exists()


class TestOwnRobot:
    def test_a_package_with_a_domain_is_installed_and_found(self, tmp_path: Path) -> None:
        site = install(tmp_path, *blocks("own-robot.md", "toml"), "own_domain.py", "own_world.py")
        (tmp_path / "clean.py").write_text(blocks("own-robot.md", "")[0])
        told = follow("evaps export --program clean.py", tmp_path, site, EVAPS_DOMAIN="vacuum")
        assert "suck" in told
        vacuum, _ = blocks("own-robot.md", "sh")
        assert "verified synthesis" in follow(vacuum, tmp_path, site)
        assert (tmp_path / "runs" / "vacuum" / "lgrl" / "model.safetensors").exists()


class TestKarel:
    def test_its_checkpoints_are_made_as_the_page_says(self, tmp_path: Path) -> None:
        _, karel = blocks("own-robot.md", "sh")
        assert "verified synthesis" in follow(karel, tmp_path, tmp_path)
        assert (tmp_path / "runs" / "karel" / "inverse" / "model.safetensors").exists()


class TestReadme:
    def test_the_commands_of_the_readme_and_of_what_it_leads_to_run(self, tmp_path: Path) -> None:
        """In the order in which they are met: README, methods, data."""
        program, _ = blocks("index.md", "python")
        scene, five = blocks("index.md", "json")
        for name, text in (("program.py", program), ("scene.json", scene), ("five.json", five)):
            (tmp_path / name).write_text(text)
        shipped = tmp_path / "runs" / "small"
        shutil.copytree(SHIPPED / "small", shipped)
        shutil.rmtree(shipped / "encoder")
        _, commands = blocks("../README.md", "sh")
        told = follow(
            commands.replace("evaps evaluate", f"cp -r {SHIPPED}/small runs; evaps evaluate"),
            tmp_path,
            tmp_path,
        )
        assert "| LGRL | " in told
        assert (tmp_path / "run.gif").exists()
        for method in ("lgrl", "evaps"):
            shutil.rmtree(shipped / method)
        told = "".join(follow(block, tmp_path, tmp_path) for block in blocks("methods.md", "sh"))
        assert "| EVAPS | " in told
        for block in blocks("data.md", "sh"):
            follow(block, tmp_path, tmp_path)
        assert (tmp_path / "data" / "paper" / "tasks.parquet").exists()
        for code in blocks("data.md", "python"):
            modules = re.findall(r"(?:^import|,) (\w+)", code, re.MULTILINE)
            if all(importlib.util.find_spec(module) for module in modules):
                follow(f"python3 - <<'END'\n{code}END", tmp_path, tmp_path)


def test_the_robots_page_shows_a_scene_and_how_to_act() -> None:
    (scene,) = blocks("robot.md", "json")
    validate(Scene.from_json(json.loads(scene)))
    (code,) = blocks("robot.md", "python")
    exec(compile(code, "robot.md", "exec"), found := {})
    assert found["info"]
    assert not found["terminated"]
