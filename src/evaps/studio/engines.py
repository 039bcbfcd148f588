"""Engines that are lent to requests: a few, so that no page can start more than the machine can bear."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from queue import Empty, SimpleQueue

from evaps.robots.base import EngineError, Robot
from evaps.robots.world import world

LONGEST_WAIT = 20.0  # seconds for a robot


class Engines:
    """Robots, each lent to one at a time.

    Args:
        robots: how many there are.
    """

    def __init__(self, robots: int = 2) -> None:
        self._all = [world().robot() for _ in range(robots)]
        self._idle: SimpleQueue[Robot] = SimpleQueue()
        for robot in self._all:
            self._idle.put(robot)

    @contextmanager
    def robot(self) -> Iterator[Robot]:
        """A robot, for as long as the block lasts.

        Raises:
            EngineError: all of them are busy for too long.
        """
        try:
            robot = self._idle.get(timeout=LONGEST_WAIT)
        except Empty:
            raise EngineError("all engines are busy; try again in a moment") from None
        try:
            yield robot
        finally:
            self._idle.put(robot)

    @property
    def replaced(self) -> int:
        """How many engines have died, or hung, and were replaced."""
        return sum(robot.replaced for robot in self._all)

    def close(self) -> None:
        """End all of them."""
        for robot in self._all:
            robot.close()
