"""A remembering robot for a whole file, and modules that tests of several rooms import."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.robots.doom import DoomRobot
from evaps.robots.memo import MemoRobot

HERE = Path(__file__).parent
sys.path += [str(HERE), str(HERE / "robots")]  # `rows`, `commands`; `robot_jobs`, `engine_processes`


@pytest.fixture(scope="module")
def robot() -> Iterator[MemoRobot]:
    robot = MemoRobot(DoomRobot(), PERCEPTION_KEYS)
    yield robot
    robot.close()
