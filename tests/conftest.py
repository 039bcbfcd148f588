"""A remembering robot for a whole file, and modules that tests of several rooms import."""

import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.robots.doom import DoomRobot
from evaps.robots.memo import MemoRobot

# A background job of a script is born deaf to Ctrl-C, and so would be the commands that tests start and stop.
signal.signal(signal.SIGINT, signal.default_int_handler)

HERE = Path(__file__).parent
sys.path += [
    str(HERE),
    str(HERE / "robots"),
]  # `rows`, `commands`, `html_tree`; `robot_jobs`, `engine_processes`


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What takes long begins first, lest one worker is left with it at the end."""
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)


@pytest.fixture(scope="module")
def robot() -> Iterator[MemoRobot]:
    robot = MemoRobot(DoomRobot(), PERCEPTION_KEYS)
    yield robot
    robot.close()
