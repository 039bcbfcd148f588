"""Figures from evaluation rows: matches among the first k, answers, and differences with their intervals."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

METRICS = ("exact", "semantic_state", "generalization_state")
TOP = (1, 5, 20)


def top_k_matches(rows: Path, method: str, metric: str, k: int) -> dict[int, bool]:
    """For each task, whether any of the method's first ``k`` candidates matches."""
    table = pq.read_table(rows, filters=[("method", "=", method), ("rank", "<", k)])
    found: dict[int, bool] = {}
    for row in table.select(["task", metric]).to_pylist():
        found[row["task"]] = found.get(row["task"], False) or row[metric]
    return found


def answers(rows: Path, method: str) -> dict[int, bool]:
    """For each task, whether the candidate that passes most pairs (of these the first) generalizes.

    This is the answer that a user gets: a method may compare what it ran with the goals, byte for byte.
    """
    return {task: row["generalization_state"] for task, row in answer_rows(rows, method).items()}


def answer_rows(rows: Path, method: str) -> dict[int, dict[str, Any]]:
    """For each task the row of the candidate that passes most pairs, of these the first."""
    best: dict[int, dict[str, Any]] = {}
    for row in pq.read_table(rows, filters=[("method", "=", method)]).to_pylist():
        key = (row["pairs_passed"], -row["rank"])
        old = best.get(row["task"])
        if old is None or key > (old["pairs_passed"], -old["rank"]):
            best[row["task"]] = row
    return best


def summarize(rows: Path) -> list[dict[str, Any]]:
    """For each method the three metrics at top-1, 5 and 20 and its answer (in %), and its cost a task."""
    table = pq.read_table(rows)
    summary = []
    for method in dict.fromkeys(table["method"].to_pylist()):
        line: dict[str, Any] = {"method": method}
        for metric in METRICS:
            for k in TOP:
                line[f"{metric}@{k}"] = 100 * float(
                    np.mean(list(top_k_matches(rows, method, metric, k).values()))
                )
        first = table.filter((pa.compute.field("method") == method) & (pa.compute.field("rank") == 0))
        line["tasks"] = first.num_rows
        line["answer"] = 100 * float(np.mean(list(answers(rows, method).values())))
        for key in ("seconds", "simulated_actions"):
            line[key] = float(np.mean(first[key].to_numpy()))
        summary.append(line)
    return summary


def paired_difference(
    rows: Path, better: str, worse: str, metric: str, k: int, seed: int = 0, draws: int = 10_000
) -> tuple[float, float, float]:
    """The difference of two methods on the same tasks in points, with its 95 % interval (paired bootstrap).

    Tasks are drawn with replacement; both methods are judged on the same draw.
    """
    a, b = (top_k_matches(rows, method, metric, k) for method in (better, worse))
    difference = np.array([100.0 * (a[task] - b[task]) for task in sorted(a)])
    rng = np.random.default_rng(seed)
    means = [difference[rng.integers(0, len(difference), len(difference))].mean() for _ in range(draws)]
    low, high = np.percentile(means, [2.5, 97.5])
    return float(difference.mean()), float(low), float(high)
