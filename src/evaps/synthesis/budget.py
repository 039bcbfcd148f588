"""What a search may cost, and what it has cost."""

from __future__ import annotations

import time
from dataclasses import dataclass

from evaps.domain import CHOSEN
from evaps.robots.memo import MemoRobot


@dataclass(frozen=True)
class Budget:
    """What a search may cost; it ends soon after either is spent.

    Attributes:
        actions: that the robot executes; what was found by then is still explained, and compared on further
            scenes, which takes 100 to 200 more.
        seconds: on the clock.
    """

    actions: int = CHOSEN.budget
    seconds: float = 8.0


USUAL_BUDGET = Budget()


class Meter:
    """Counts from when it is made.

    Args:
        robot: whose actions count.
    """

    def __init__(self, robot: MemoRobot) -> None:
        self._robot = robot
        self._start, self._simulated = time.perf_counter(), robot.simulated_actions

    @property
    def actions(self) -> int:
        """Actions that were simulated."""
        return self._robot.simulated_actions - self._simulated

    @property
    def seconds(self) -> float:
        """On the clock."""
        return time.perf_counter() - self._start

    def exceeds(self, budget: Budget) -> bool:
        """Whether a budget is spent."""
        return self.seconds > budget.seconds or self.actions >= budget.actions
