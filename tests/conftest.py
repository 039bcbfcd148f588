"""A remembering robot for a whole file, and shapes that are checked where they are written."""

from collections.abc import Iterator

import pytest
from jaxtyping import install_import_hook

install_import_hook("evaps.models", "beartype.beartype")  # before any test imports a model

from evaps.dsl.sampler import PERCEPTION_KEYS  # noqa: E402
from evaps.robots.doom import DoomRobot  # noqa: E402
from evaps.robots.memo import MemoRobot  # noqa: E402


@pytest.fixture(scope="module")
def robot() -> Iterator[MemoRobot]:
    robot = MemoRobot(DoomRobot(), PERCEPTION_KEYS)
    yield robot
    robot.close()
