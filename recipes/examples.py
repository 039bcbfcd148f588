"""Makes the task folders in examples/tasks: programs that people would want, scenes by seed.

    python -m recipes.examples

The programs stand here for everybody to see; they are not in the folders, and no method reads this file.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

from evaps.dsl import Program
from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.robots.doom import DoomRobot
from evaps.robots.memo import MemoRobot
from evaps.robots.scenes import random_scene
from evaps.tasks.generate import draft_task
from evaps.tasks.questions import OpenProgram
from evaps.tasks.task import EXAMPLES, Example, Task, save_task
from recipes.command import start

FOLDER = Path("examples/tasks")
SEED = 2023

# All of them are in the test split of every data set (`split_of`): no shipped model has learned from them.
PROGRAMS = {
    "sidestep-and-shoot": "def run():\n    move_left()\n    attack()\n",
    "look-around": "def run():\n    turn_left()\n    turn_left()\n    turn_left()\n",
    "back-off-from-a-revenant": (
        "def run():\n    move_forward()\n    if in_target(Revenant):\n        move_backward()\n"
    ),
    "sidestep-or-advance": (
        "def run():\n    if is_there(HellKnight):\n        move_right()\n    else:\n        move_forward()\n"
        "    attack()\n"
    ),
    "retreat-from-demons": (
        "def run():\n    if is_there(Demon):\n        move_backward()\n        move_backward()\n"
        "    turn_right()\n"
    ),
    "turn-until-in-target": (
        "def run():\n    while not in_target(Demon):\n        turn_left()\n    attack()\n"
    ),
}


def make_task(name: str, program: Program, robot: MemoRobot) -> Task:
    """A task of the program: the first scenes of the seed on which it halts and takes every branch."""
    rng = np.random.default_rng(SEED)
    while True:
        scenes = [random_scene(rng) for _ in range(40)]
        draft = draft_task(OpenProgram(program, is_open=False), scenes, robot, rng)
        if draft is not None:
            examples = list(map(Example, draft.scenes[:EXAMPLES], draft.last))
            return Task(name, tuple(examples))


def main() -> None:
    """Make all task folders anew."""
    robot = MemoRobot(DoomRobot(), PERCEPTION_KEYS)
    for name, text in PROGRAMS.items():
        shutil.rmtree(FOLDER / name, ignore_errors=True)
        save_task(make_task(name, Program.parse(text), robot), FOLDER / name)
        robot.forget()
    robot.close()


if __name__ == "__main__":
    start(main)
