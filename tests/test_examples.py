"""The shipped tasks: their programs solve them, and no model can have learned from these programs."""

import runpy
from pathlib import Path

import pytest

from evaps.dsl import Program
from evaps.robots.memo import MemoRobot
from evaps.synthesis.solution import attempt
from evaps.tasks.dataset import split_of
from evaps.tasks.task import load_task

ROOT = Path(__file__).parents[1]
PROGRAMS = runpy.run_path(str(ROOT / "recipes" / "examples.py"))["PROGRAMS"]


def test_every_folder_has_its_program() -> None:
    assert {path.name for path in (ROOT / "examples" / "tasks").iterdir()} == set(PROGRAMS)


@pytest.mark.parametrize("name", PROGRAMS)
def test_its_program_solves_it_and_is_kept_from_training(name: str, robot: MemoRobot) -> None:
    program = Program.parse(PROGRAMS[name])
    task = load_task(ROOT / "examples" / "tasks" / name)
    assert attempt(program, task, robot).solved
    assert split_of(program) == "test"
    wrong = Program.parse("DEF run m( MOVE_BACKWARD MOVE_BACKWARD ATTACK m)")
    assert not attempt(wrong, task, robot).solved
