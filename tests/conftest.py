"""A remembering robot for a whole file."""

from collections.abc import Iterator

import pytest

from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.robots.doom import DoomRobot
from evaps.robots.memo import MemoRobot


@pytest.fixture(scope="module")
def robot() -> Iterator[MemoRobot]:
    robot = MemoRobot(DoomRobot(), PERCEPTION_KEYS)
    yield robot
    robot.close()
