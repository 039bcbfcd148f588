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


Outcome = tuple[tuple[str, ...], bytes, WorldState, int]


def lose_the_engine_once(robot: MemoRobot, item: tuple[int, Path]) -> Outcome:
    """The same; the first time that an item is done, the engine is killed before it."""
    seed, marker = item
    if not marker.exists():
        marker.touch()
        robot.reset(random_scene(np.random.default_rng(99)))
        for engine in find_engines(os.getpid()):
            os.kill(engine, signal.SIGKILL)
        robot.forget()
    return random_run(robot, seed)


def die_once(robot: MemoRobot, item: tuple[int, Path]) -> Outcome:
    """The same; whoever is the first to come to a marker is killed in the middle of it."""
    seed, marker = item
    robot.reset(random_scene(np.random.default_rng(99)))
    if not marker.exists():
        marker.write_text(str(os.getpid()))
        os.kill(os.getpid(), signal.SIGKILL)
    robot.forget()
    return random_run(robot, seed)


def die(robot: MemoRobot, seed: int) -> None:
    """An item that no worker survives."""
    os.kill(os.getpid(), signal.SIGKILL)


def die_of_one(robot: MemoRobot, seed: int) -> int:
    """The item 5 is one that no worker survives."""
    if seed == 5:
        os.kill(os.getpid(), signal.SIGKILL)
    return seed


def fail(robot: MemoRobot, item: int) -> None:
    raise LookupError(f"item {item} cannot be done")


def play_for_ever(robot: MemoRobot, seed: int) -> None:
    for i in count():
        robot.forget()
        robot.reset(random_scene(np.random.default_rng(seed + i)))
        robot.act("ATTACK")
        Path(f"plays-{os.getpid()}").touch()  # its engine has started, which happens when it is needed
