"""Figures from evaluation rows: matches among the first k, answers, and how methods differ.

Rows of several methods and seeds may lie in one file or in many; each (method, seed) is one set of results.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from jaxtyping import Bool, Float

from evaps.bootstrap import DRAWS, Interval, bootstraps
from evaps.dsl import UserError
from evaps.rows import check_one_setting, read_rows, row_files

TITLES = {"exact": "exact", "semantic_state": "semantic", "generalization_state": "generalization"}
"""What the paper calls its metrics, by our columns; the tables show the match of states."""
METRICS = tuple(TITLES)
OF_THE_LAST = ("exact", "semantic_frame", "generalization_frame", "rounds")
"""What a row says of its candidate after the last round of repair, and not of the attempts before."""
JUDGED = (*METRICS, "semantic_frame", "generalization_frame")
NEEDED = ("method", "seed", "task", "rank", *METRICS)
"""Columns without which there is nothing to count."""
TOP = (1, 5, 20)
Row = Mapping[str, Any]


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
        return self._first_match[metric] < k

    @cached_property
    def _first_match(self) -> dict[str, np.ndarray[Any, Any]]:
        """By metric the rank of each task's first candidate that matches, or infinity."""
        return {
            metric: np.array(
                [min((r["rank"] for r in self.rows[t] if r.get(metric)), default=np.inf) for t in self.tasks]
            )
            for metric in JUDGED
        }

    @cached_property
    def asked(self) -> float:
        """How many candidates were asked for; infinity if rows of an earlier evaps do not say so."""
        return self.fact("top_k") or np.inf

    def fact(self, key: str) -> Any:
        """What is the same in all rows, such as ``"scale"``; None if they do not say it."""
        return self.rows[self.tasks[0]][0].get(key)

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

    @property
    def most_attempts(self) -> int:
        """As many programs as were run at most for a task's first candidate: itself and its repairs."""
        return max(len(_attempts(self.rows[t][0])) for t in self.tasks)

    def first(self, task: int, k: int) -> list[Row]:
        """The first ``k`` candidates of a task."""
        return [row for row in self.rows[task] if row["rank"] < k]


def _attempts(row: Row) -> Sequence[Row]:
    """What a candidate was, from the proposal on; the row itself where that was not kept."""
    return row.get("attempts") or [row]


def attempt_after(row: Row, rounds: int) -> Row:
    """What a candidate was after so many rounds of repair, or after its last where it had fewer."""
    attempts: Sequence[Row] = row["attempts"]
    return attempts[min(rounds, len(attempts) - 1)]


def _best_attempt(row: Row) -> Row:
    """The row as if its candidate had ended with the first attempt that passes most pairs.

    Without what rows know of the last attempt alone.
    """
    best = max(_attempts(row), key=lambda attempt: attempt["pairs_passed"])
    return {**row, **dict.fromkeys(OF_THE_LAST), **best}


Judge = Callable[[MethodResults], Bool[np.ndarray, " task"]]
"""Says for each task whether it is solved."""


def among_first(metric: str, k: int) -> Judge:
    """Solved if one of the first candidates matches."""
    return lambda run: run.matches(metric, k)


def answered_among(k: int) -> Judge:
    """Solved if the answer among the first candidates generalizes."""
    return lambda run: run.answered(k)


class Results:
    """Evaluation rows of several methods and seeds.

    Args:
        tables: of rows.

    Raises:
        UserError: they are not of one split of one data set with one noise, as many candidates and rounds of
            repair, a candidate has two rows, or a method was trained on more, or judged on other tasks, with
            one seed than with another.
    """

    def __init__(self, tables: Sequence[pa.Table]) -> None:
        check_one_setting(tables)
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
            _check_one_method(seeds[0], seeds[-1])

    @classmethod
    def read(cls, *paths: Path) -> Results:
        """Read files of rows, of a folder all that are in it.

        Raises:
            UserError: there are none, or they do not belong together.
        """
        return cls([read_rows(file, NEEDED) for path in paths for file in row_files(path)])

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
        for file in row_files(path):
            table = read_rows(file, NEEDED)
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

    @cached_property
    def usual_machine(self) -> str:
        """The one that most results are of."""
        return Counter(str(run.fact("machine")) for run in self.each()).most_common(1)[0][0]

    def timed(self, method: str) -> list[MethodResults]:
        """The results of a method whose seconds may be told beside others': those on the usual machine.

        Where it was never judged on it, all of its results.
        """
        runs = self.by_method[method]
        return [run for run in runs if str(run.fact("machine")) == self.usual_machine] or runs

    def of_methods(self, methods: Collection[str]) -> Results:
        """The same results of some of the methods only."""
        fewer = copy(self)
        fewer.by_method = {method: runs for method, runs in self.by_method.items() if method in methods}
        return fewer

    def of_tasks(self, tasks: Collection[int]) -> Results:
        """The same results on some of the tasks only."""
        fewer, wanted = copy(self), set(tasks)
        fewer.by_method = {
            method: [replace(run, rows={t: run.rows[t] for t in run.tasks if t in wanted}) for run in runs]
            for method, runs in self.by_method.items()
        }
        return fewer

    def top(self, method: str, metric: str, k: int) -> Float[np.ndarray, " seed"]:
        """For each seed the share of tasks, in %, on which any of the first ``k`` candidates matches.

        It is nan where fewer candidates were asked for.
        """
        runs = self.by_method[method]
        return np.array([100 * r.matches(metric, k).mean() if k <= r.asked else np.nan for r in runs])

    def shared_seeds(self, one: str, other: str) -> list[int]:
        """The seeds that two methods both have."""
        return sorted({r.seed for r in self.by_method[one]} & {r.seed for r in self.by_method[other]})

    def difference(
        self, better: str, worse: str, metric: str, k: int, seed: int = 0, draws: int = DRAWS
    ) -> Interval:
        """The difference of two methods in points; see `differences`."""
        return self.differences(better, worse, metric, (k,), seed, draws)[0]

    def differences(
        self,
        better: str,
        worse: str,
        metric: str,
        ks: Sequence[int] = TOP,
        seed: int = 0,
        draws: int = DRAWS,
    ) -> list[Interval]:
        """For each k the difference of two methods in points, on the same tasks and seeds.

        A paired bootstrap (`evaps.bootstrap`): both methods are judged on the same draw of tasks and seeds.
        With one seed the interval tells how much the choice of test tasks matters, and nothing about
        training again.

        Raises:
            ValueError: they were judged on different tasks, or with fewer candidates, or share no seed.
        """
        for method in (better, worse):
            if any(max(ks) > run.asked for run in self.by_method[method]):
                raise ValueError(f"{method} was not asked for {max(ks)} candidates")
        gains = [self.gains(better, worse, among_first(metric, k)) for k in ks]
        return bootstraps(np.stack(gains), seed, draws)

    def gains(
        self, better: str, worse: str, right: Judge, right_of_worse: Judge | None = None
    ) -> Float[np.ndarray, "seed task"]:
        """What one method has more than another: 100, 0 or -100 for each seed that both have and each task.

        Args:
            better: the one.
            worse: the other.
            right: for each task whether a method's results solve it.
            right_of_worse: the same for the other method, if it is judged in another way.

        Raises:
            ValueError: they were judged on different tasks, or share no seed.
        """
        seeds = self.shared_seeds(better, worse)
        runs = [{r.seed: r for r in self.by_method[method]} for method in (better, worse)]
        pairs = [(runs[0][s], runs[1][s]) for s in seeds]
        if not seeds or any(a.tasks != b.tasks for a, b in pairs):
            raise ValueError(f"{better} and {worse} were not judged on the same tasks with the same seeds")
        return np.array([100.0 * right(a) - 100.0 * (right_of_worse or right)(b) for a, b in pairs])


ONE_METHOD = ("scale", "trained_on", "budget")
"""Columns that have to be the same in all rows of a method."""


def _check_one_method(one: MethodResults, other: MethodResults) -> None:
    """The seeds of a method are averaged, so nothing but the seed may differ."""
    what = f"{one.method}, seed {one.seed} and seed {other.seed},"
    if one.tasks != other.tasks:
        raise UserError(f"{what} were judged on different tasks; evaluate both with the same --tasks")
    for column in ONE_METHOD:
        values = {one.fact(column), other.fact(column)} - {None}
        if len(values) > 1:
            raise UserError(
                f"{what} differ in {column}: {', '.join(sorted(map(str, values)))}; "
                "put each kind into a folder of its own"
            )
