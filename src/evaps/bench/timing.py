"""What a measurement is."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

SEED = 0
ROUNDS = 5  # of each pair of things that are compared; the best of each counts


@dataclass(frozen=True)
class Figure:
    """One line of the table.

    Attributes:
        name: what was measured.
        value: how much.
        unit: of what.
        target: what it should be, as text; empty if there is no target.
    """

    name: str
    value: float
    unit: str
    target: str = ""


def seconds_of(work: Callable[[], object]) -> float:
    """How long it takes once."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def best_of(*works: Callable[[], object], rounds: int = ROUNDS) -> list[float]:
    """The shortest time of each work, taken in turns, so that a noisy moment meets all of them."""
    times = [[seconds_of(work) for work in works] for _ in range(rounds)]
    return [min(column) for column in zip(*times, strict=True)]
