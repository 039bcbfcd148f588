"""Engines that tests share, and the way to find the processes they run in."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from evaps.robots.doom import DoomRobot

Engines = Callable[[int], set[int]]


@pytest.fixture(scope="session")
def engines() -> Engines:
    if not Path("/proc/self/task").exists():
        pytest.skip("finding the engine's process needs /proc")
    from engine_processes import find_engines

    return find_engines


@pytest.fixture(scope="module")
def robot() -> Iterator[DoomRobot]:
    """An engine for a whole file: every test puts it into a scene of its own."""
    robot = DoomRobot()
    yield robot
    robot.close()
