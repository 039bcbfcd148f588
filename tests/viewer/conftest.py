"""Answers to small tasks, made on the real engine without a model."""

from collections.abc import Sequence

import numpy as np
import pytest

from evaps.dsl import Program, run
from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.robots.doom import DoomRobot
from evaps.robots.memo import MemoRobot
from evaps.robots.scenes import random_scene
from evaps.synthesis.solution import Candidate, Solution, attempt, best_first
from evaps.tasks.task import EXAMPLES, Example, Task
from evaps.viewer.story import TaskReport

GOLD = """
def run():
    if is_there(Demon):
        for _ in range(2):
            turn_left()
    else:
        move_right()
    attack()
"""
WRONG = """
def run():
    while in_target(Revenant):
        move_left()
    if is_there(Demon):
        turn_right()
    else:
        if not is_there(Revenant):
            move_right()
    attack()
"""
BETTER = """
def run():
    if is_there(Demon):
        turn_left()
    else:
        move_right()
    attack()
"""
ENDLESS = """
def run():
    while not in_target(Demon):
        turn_left()
"""
SILENT = """
def run():
    move_forward()
    while not in_target(Demon):
        if in_target(Demon):
            attack()
"""


class World:
    """An engine, the same scenes for all tasks, and reports of made-up searches on them."""

    def __init__(self) -> None:
        self.robot = MemoRobot(DoomRobot(), PERCEPTION_KEYS)
        rng = np.random.default_rng(0)  # two of the five scenes show a Demon
        self.scenes = [random_scene(rng) for _ in range(EXAMPLES)]

    def task(self, name: str, gold: str) -> Task:
        examples = []
        for scene in self.scenes:
            self.robot.reset(scene)
            trace = run(Program.parse(gold), self.robot)
            assert trace.halted
            examples.append(Example(scene, trace.observations[-1]))
        return Task(name, tuple(examples))

    def report(self, name: str, *chains: Sequence[str], gold: str = GOLD) -> TaskReport:
        """What comes of candidates of which each is a chain of programs: a proposal and its repairs."""
        task = self.task(name, gold)
        candidates = []
        for rank, chain in enumerate(chains):
            attempts = tuple(attempt(Program.parse(text), task, self.robot) for text in chain)
            origin = "LGRL" if len(chain) == 1 else f"LGRL + EVAPS x{len(chain) - 1}"
            candidates.append(Candidate(attempts, rank, origin))
        return TaskReport(task, Solution(name, best_first(candidates), self.robot.simulated_actions, 1.25))


@pytest.fixture(scope="session")
def world():
    world = World()
    yield world
    world.robot.close()


@pytest.fixture(scope="session")
def repaired(world):
    return world.report("turn and shoot <b>&", [WRONG, BETTER, GOLD], [ENDLESS], [WRONG])


@pytest.fixture(scope="session")
def at_once(world):
    return world.report("easy", [GOLD])


@pytest.fixture(scope="session")
def unsolved(world):
    return world.report("hard", [ENDLESS, BETTER], [SILENT], [WRONG])
