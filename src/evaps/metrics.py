"""Figures from evaluation rows: matches among the first k, answers, and differences with their intervals.

Rows of several methods and seeds may lie in one file or in many; each (method, seed) is one set of results.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from jaxtyping import Bool, Float

from evaps.dsl import UserError
from evaps.tasks.files import read_table

TITLES = {"exact": "exact", "semantic_state": "semantic", "generalization_state": "generalization"}
"""What the paper calls its metrics, by our columns; the tables show the match of states."""
METRICS = tuple(TITLES)
TOP = (1, 5, 20)
DRAWS = 10_000
DRAWN_TOGETHER = 1 << 20  # tasks, so that a bootstrap of any number of them takes a few megabytes
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
        return np.array([any(r[metric] for r in self.first(t, k)) for t in self.tasks])

    def column(self, key: str) -> np.ndarray[Any, Any]:
        """A fact that is the same in all rows of a task, such as ``"steps"``."""
        return np.array([self.rows[t][0][key] for t in self.tasks])

    def answers(self, k: int = max(TOP)) -> list[Row]:
        """For each task the attempt that passes most pairs, of these the first; with the facts of its row.

        This is what a user gets: a method may compare what it ran with the goals, byte for byte, and what a
        repair made worse is not lost.

        Args:
            k: among so many candidates.
        """
        return [
            max(map(_best_attempt, self.first(t, k)), key=lambda r: (r["pairs_passed"], -r["rank"]))
            for t in self.tasks
        ]

    def answered(self, k: int = max(TOP)) -> Bool[np.ndarray, " task"]:
        """For each task whether the answer among the first ``k`` candidates generalizes."""
        return np.array([row["generalization_state"] for row in self.answers(k)])

    def programs_run(self, k: int) -> float:
        """Distinct programs that the first ``k`` candidates of a task and their repairs are: the mean."""
        programs = ({a["program"] for row in self.first(t, k) for a in _attempts(row)} for t in self.tasks)
        return float(np.mean([len(distinct) for distinct in programs]))

    def first(self, task: int, k: int) -> list[Row]:
        """The first ``k`` candidates of a task."""
        return [row for row in self.rows[task] if row["rank"] < k]


def _attempts(row: Row) -> Sequence[Row]:
    """What a candidate was, from the proposal on; the row itself where that was not kept."""
    return row.get("attempts") or [row]


def _best_attempt(row: Row) -> Row:
    """The row as if its candidate had ended with the first attempt that passes most pairs."""
    return {**row, **max(_attempts(row), key=lambda attempt: attempt["pairs_passed"])}


class Results:
    """Evaluation rows of several methods and seeds.

    Args:
        tables: of rows.

    Raises:
        UserError: they are not of one split of one data set with one noise, a candidate has two rows, or a
            method was judged on other tasks with one seed than with another.
    """

    def __init__(self, tables: Sequence[pa.Table]) -> None:
        _check_one_setting(tables)
        found: dict[tuple[str, int], dict[int, dict[int, Row]]] = {}
        for table in tables:
            for row in table.to_pylist():
                tasks = found.setdefault((row["method"], row["seed"]), {})
                ranks = tasks.setdefault(row["task"], {})
                if row["rank"] in ranks:
                    raise UserError(
                        f"task {row['task']} has two rows of {row['method']}, seed {row['seed']}, "
                        f"rank {row['rank']}; keep one evaluation of it"
                    )
                ranks[row["rank"]] = row
        self.by_method: dict[str, list[MethodResults]] = {}
        for (method, seed), tasks in sorted(found.items(), key=lambda item: item[0][1]):
            by_rank = {task: [ranks[rank] for rank in sorted(ranks)] for task, ranks in tasks.items()}
            seeds = self.by_method.setdefault(method, [])
            seeds.append(MethodResults(method, seed, by_rank))
            if seeds[0].tasks != seeds[-1].tasks:
                raise UserError(
                    f"{method} was judged on other tasks with seed {seed} than with seed {seeds[0].seed}; "
                    "evaluate both with the same --tasks"
                )

    @classmethod
    def read(cls, *paths: Path) -> Results:
        """Read files of rows, of a folder all that are in it.

        Raises:
            UserError: there are none, or they do not belong together.
        """
        return cls([_read(file) for path in paths for file in _files(path)])

    @classmethod
    def by_column(cls, path: Path, column: str) -> dict[float, Results]:
        """The files of rows in a folder, by a number that is the same in all rows of a file, in its order.

        Args:
            path: of the folder.
            column: such as ``"noise"``.

        Raises:
            UserError: there are none, they were made before there was such a column, or they do not belong
                together.
        """
        tables: dict[float, list[pa.Table]] = {}
        for file in _files(path):
            table = _read(file)
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

    def of_tasks(self, tasks: Collection[int]) -> Results:
        """The same results on some of the tasks only."""
        fewer, wanted = copy(self), set(tasks)
        fewer.by_method = {
            method: [replace(run, rows={t: run.rows[t] for t in run.tasks if t in wanted}) for run in runs]
            for method, runs in self.by_method.items()
        }
        return fewer

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


ONE_SETTING = ("dataset_seed", "split", "noise")
"""Columns that have to be the same in rows that are compared."""


def _check_one_setting(tables: Sequence[pa.Table]) -> None:
    for column in ONE_SETTING:
        there = [table[column].unique().to_pylist() for table in tables if column in table.column_names]
        values = sorted({value for found in there for value in found if value is not None})
        if len(values) > 1:
            raise UserError(
                f"these rows are of more than one {column}: {', '.join(f'{value}' for value in values)}; "
                "put each kind into a folder of its own"
            )


def _read(file: Path) -> pa.Table:
    """The rows in a file.

    Raises:
        UserError: it cannot be read, or holds something else.
    """
    table = read_table(file)
    if missing := sorted({"method", "seed", "task", "rank", *METRICS} - set(table.column_names)):
        raise UserError(f"{file} holds no rows of evaps evaluate: it has no column {missing[0]!r}")
    if not len(table):
        raise UserError(f"{file} holds no rows; evaluate again")
    return table


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
    together = max(1, DRAWN_TOGETHER // tasks)
    means = np.empty(draws)
    for start in range(0, draws, together):
        size = min(together, draws - start)
        picked = rng.integers(0, tasks, (size, tasks))
        by_seed = np.stack([row[picked].mean(1) for row in values], 1)
        chosen = rng.integers(0, seeds, (size, seeds))
        means[start : start + size] = np.take_along_axis(by_seed, chosen, 1).mean(1)
    low, high = np.percentile(means, [2.5, 97.5])
    return Interval(float(values.mean()), float(low), float(high))
