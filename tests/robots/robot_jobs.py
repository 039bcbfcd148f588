"""Work for robots in other processes, which import it from here."""

import os
import signal
from itertools import count
from pathlib import Path

import numpy as np
from engine_processes import find_engines

from evaps.dsl import run
from evaps.dsl.sampler import sample_program
from evaps.robots.base import WorldState
from evaps.robots.memo import MemoRobot
from evaps.robots.scenes import random_scene


def random_run(robot: MemoRobot, seed: int) -> tuple[tuple[str, ...], bytes, WorldState, int]:
    """A random program on a random scene: actions, last view, state, and what it took to simulate it."""
    rng = np.random.default_rng(seed)
    simulated = robot.simulated_actions
    robot.reset(random_scene(rng))
    trace = run(sample_program(rng), robot)
    simulated = robot.simulated_actions - simulated
    return trace.actions, trace.observations[-1].rgb.tobytes(), robot.state(), simulated


def run_and_lose_the_engine_once(
    robot: MemoRobot, item: tuple[int, Path]
) -> tuple[tuple[str, ...], bytes, WorldState, int]:
    """The same; the first time that an item is done, the engine is killed before it."""
    seed, marker = item
    robot.reset(random_scene(np.random.default_rng(99)))
    if not marker.exists():
        marker.touch()
        for engine in find_engines(os.getpid()):
            os.kill(engine, signal.SIGKILL)
    return random_run(robot, seed)


def lose_the_engine(robot: MemoRobot, seed: int) -> None:
    """An item that no engine survives."""
    robot.reset(random_scene(np.random.default_rng(seed)))
    for engine in find_engines(os.getpid()):
        os.kill(engine, signal.SIGKILL)
    robot.act("ATTACK")


def fail(robot: MemoRobot, item: int) -> None:
    raise LookupError(f"item {item} cannot be done")


def play_for_ever(robot: MemoRobot, seed: int) -> None:
    for i in count():
        robot.forget()
        robot.reset(random_scene(np.random.default_rng(seed + i)))
        robot.act("ATTACK")
