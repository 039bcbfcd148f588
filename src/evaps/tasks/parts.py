"""Long jobs in parts: each part becomes a file, so a job can be stopped at any moment and goes on later."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.robots.memo import MemoRobot
from evaps.robots.workers import robot_map
from evaps.tasks.dataset import Dataset, gold_task
from evaps.tasks.progress import track
from evaps.tasks.task import GoldTask


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


@dataclass(frozen=True)
class TaskPart:
    """Some tasks of a data set, and the file that is made of them.

    Attributes:
        path: the file.
        positions: of the tasks in :attr:`Dataset.rows`.
        rows: the tasks, as in :attr:`Dataset.rows`.
        goals: their goal frames, packed; empty where the file is there already.
    """

    path: Path
    positions: tuple[int, ...]
    rows: tuple[dict[str, Any], ...]
    goals: tuple[list[bytes], ...]

    def golds(self) -> Iterator[GoldTask]:
        """The tasks with their answers."""
        return (gold_task(row, goals) for row, goals in zip(self.rows, self.goals, strict=True))


def task_parts(folder: Path, dataset: Dataset, positions: Sequence[int], size: int) -> Iterator[TaskPart]:
    """Tasks of a data set in parts of ``size``, whose files are numbered in ``folder``."""
    for number, start in enumerate(range(0, len(positions), size)):
        chosen = tuple(positions[start : start + size])
        path = folder / f"part-{number:05d}.parquet"
        goals = {} if path.exists() else {p: last for p, _, last in dataset.frames(chosen)}
        rows = tuple(dataset.rows[p] for p in chosen)
        yield TaskPart(path, chosen, rows, tuple(goals.get(p, []) for p in chosen))
