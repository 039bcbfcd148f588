"""The engines that synthesis is quickest with, and a robot that remembers on them."""

from __future__ import annotations

from collections.abc import Sequence

from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.robots.base import Robot
from evaps.robots.memo import MemoRobot
from evaps.robots.world import world
from evaps.tasks.task import EXAMPLES

SPARES = EXAMPLES - 1
"""Engines beside the first one: with them there is one for each scene."""


def team_of_robots() -> list[Robot]:
    """As many robots of the domain; whoever makes them closes them."""
    return [world().robot() for _ in range(1 + SPARES)]


def memo_of(team: Sequence[Robot]) -> MemoRobot:
    """A robot that remembers nothing yet and simulates on these; its ``close()`` closes them all."""
    return MemoRobot(team[0], PERCEPTION_KEYS, spares=team[1:])
