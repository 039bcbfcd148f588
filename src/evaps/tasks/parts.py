"""Long jobs in parts: each part becomes a file, so a job can be stopped at any moment and goes on later."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol, TypeVar

from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.robots.memo import MemoRobot
from evaps.robots.workers import robot_map
from evaps.tasks.progress import track


class Part(Protocol):
    """Some of the work: all that it depends on, and the file that means that it is done."""

    @property
    def path(self) -> Path:
        """Written last, and atomically."""


P = TypeVar("P", bound=Part)


def make_parts(
    make: Callable[[MemoRobot, P], None], parts: Sequence[P], workers: int, what: str, size: int
) -> list[Path]:
    """Make those parts whose files are not there yet.

    Args:
        make: a module-level function that makes a part.
        parts: all of them.
        workers: processes.
        what: what a part holds, for the progress.
        size: how many of these a part holds.

    Returns:
        the files of all parts.
    """
    missing = [part for part in parts if not part.path.exists()]
    results = robot_map(make, missing, workers, PERCEPTION_KEYS)
    done = (len(parts) - len(missing)) * size
    for _ in track(results, len(parts) * size, what, done, size):
        pass
    return [part.path for part in parts]
