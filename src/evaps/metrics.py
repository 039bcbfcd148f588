"""Figures from evaluation rows: matches among the first k, answers, and differences with their intervals.

Rows of several methods and seeds may lie in one file or in many; each (method, seed) is one set of results.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from jaxtyping import Bool, Float

from evaps.dsl import UserError

METRICS = ("exact", "semantic_state", "generalization_state")
TOP = (1, 5, 20)
DRAWS = 10_000
Row = Mapping[str, Any]


class Interval(NamedTuple):
    """A mean with its 95 % interval, in points."""

    mean: float
    low: float
    high: float

    @property
    def certain(self) -> bool:
        """Whether the interval leaves the sign no doubt."""
        return self.low > 0 or self.high < 0


@dataclass(frozen=True)
class MethodResults:
    """The rows of one method and seed.

    Attributes:
        method: its name.
        seed: of its training.
        rows: for each task its candidates by rank.
    """

    method: str
    seed: int
    rows: Mapping[int, Sequence[Row]]

    @cached_property
    def tasks(self) -> list[int]:
        """Their indices, in order."""
        return sorted(self.rows)

    def each(self) -> Iterator[Row]:
        """All rows, task by task."""
        for task in self.tasks:
            yield from self.rows[task]

    def matches(self, metric: str, k: int) -> Bool[np.ndarray, " task"]:
        """For each task whether any of the first ``k`` candidates matches."""
        return np.array([any(r[metric] for r in self.rows[t] if r["rank"] < k) for t in self.tasks])

    def column(self, key: str) -> np.ndarray[Any, Any]:
        """A fact that is the same in all rows of a task, such as ``"steps"``."""
        return np.array([self.rows[t][0][key] for t in self.tasks])

    def answers(self) -> list[Row]:
        """For each task the row of the candidate that passes most pairs, of these the first.

        This is what a user gets: a method may compare what it ran with the goals, byte for byte.
        """
        return [max(self.rows[t], key=lambda r: (r["pairs_passed"], -r["rank"])) for t in self.tasks]

    def answered(self) -> Bool[np.ndarray, " task"]:
        """For each task whether the answer generalizes."""
        return np.array([row["generalization_state"] for row in self.answers()])


class Results:
    """Evaluation rows of several methods and seeds.

    Args:
        tables: of rows.
    """

    def __init__(self, tables: Sequence[pa.Table]) -> None:
        found: dict[tuple[str, int], dict[int, list[Row]]] = {}
        for table in tables:
            for row in table.to_pylist():
                tasks = found.setdefault((row["method"], row["seed"]), {})
                tasks.setdefault(row["task"], []).append(row)
        for tasks in found.values():
            for rows in tasks.values():
                rows.sort(key=lambda r: r["rank"])
        self.by_method: dict[str, list[MethodResults]] = {}
        for (method, seed), tasks in sorted(found.items(), key=lambda item: item[0][1]):
            self.by_method.setdefault(method, []).append(MethodResults(method, seed, tasks))

    @classmethod
    def read(cls, path: Path) -> Results:
        """Read a file of rows, or all files in a folder.

        Raises:
            UserError: there are none.
        """
        return cls([pq.read_table(file) for file in _files(path)])

    @classmethod
    def by_column(cls, path: Path, column: str) -> dict[float, Results]:
        """The files of rows in a folder, by a number that is the same in all rows of a file, in its order.

        Args:
            path: of the folder.
            column: such as ``"noise"``.

        Raises:
            UserError: there are none, or they were made before there was such a column.
        """
        tables: dict[float, list[pa.Table]] = {}
        for file in _files(path):
            table = pq.read_table(file)
            if column not in table.column_names:
                raise UserError(
                    f"{file} has no column {column!r}: it was made by an earlier evaps; evaluate again"
                )
            tables.setdefault(round(float(table[column][0].as_py()), 4), []).append(table)
        return {key: cls(tables[key]) for key in sorted(tables)}

    @property
    def methods(self) -> list[str]:
        """Their names."""
        return list(self.by_method)

    def each(self) -> Iterator[MethodResults]:
        """All results, method by method."""
        for runs in self.by_method.values():
            yield from runs

    def first(self, method: str) -> MethodResults:
        """The results of a method's first seed."""
        return self.by_method[method][0]

    def top(self, method: str, metric: str, k: int) -> Float[np.ndarray, " seed"]:
        """For each seed the share of tasks, in %, on which any of the first ``k`` candidates matches."""
        return np.array([100 * run.matches(metric, k).mean() for run in self.by_method[method]])

    def difference(
        self, better: str, worse: str, metric: str, k: int, seed: int = 0, draws: int = DRAWS
    ) -> Interval:
        """The difference of two methods in points, on the same tasks and seeds: a paired bootstrap.

        Seeds and tasks are drawn with replacement; both methods are judged on the same draw. With one seed
        the interval tells how much the choice of test tasks matters, and nothing about training again.

        Raises:
            ValueError: they were judged on different tasks, or share no seed.
        """
        runs = [{r.seed: r for r in self.by_method[method]} for method in (better, worse)]
        seeds = sorted(runs[0].keys() & runs[1].keys())
        if not seeds or any(runs[0][s].tasks != runs[1][s].tasks for s in seeds):
            raise ValueError(f"{better} and {worse} were not judged on the same tasks with the same seeds")
        gains = np.stack(
            [100.0 * runs[0][s].matches(metric, k) - 100.0 * runs[1][s].matches(metric, k) for s in seeds]
        )
        return bootstrap(gains, seed, draws)


def _files(path: Path) -> list[Path]:
    files = sorted(path.glob("*.parquet")) if path.is_dir() else [path]
    if not files or not files[0].exists():
        raise UserError(f"{path} holds no rows; make some with: evaps evaluate --out {path}/NAME.parquet")
    return files


def bootstrap(values: Float[np.ndarray, "seed task"], seed: int = 0, draws: int = DRAWS) -> Interval:
    """The mean over seeds and tasks, and its percentile bootstrap interval.

    Args:
        values: one number for each seed and task.
        seed: of the draws.
        draws: how many.
    """
    rng = np.random.default_rng(seed)
    seeds, tasks = values.shape
    means = np.empty(draws)
    for draw in range(draws):
        # a sample of tasks is how often each of them is drawn: quicker than picking their columns
        weights = np.bincount(rng.integers(0, tasks, tasks), minlength=tasks)
        means[draw] = (values[rng.integers(0, seeds, seeds)] @ weights).mean() / tasks
    low, high = np.percentile(means, [2.5, 97.5])
    return Interval(float(values.mean()), float(low), float(high))
