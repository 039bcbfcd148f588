"""Short tables of the one answer that a user would get: how often it is right, and what it costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from evaps.metrics import Results, Row
from evaps.report.names import name_of
from evaps.report.table import markdown_cells
from evaps.report.wording import GOAL
from evaps.tasks.info import STEP_BUCKETS, step_bucket
from evaps.tasks.task import EXAMPLES


def answer_table(*judged: Results) -> str:
    """Markdown: the one answer of each method that there are results of, of all seeds, and its cost.

    Seconds are of the seeds that were judged on the usual machine (`Results.timed`). First comes whose
    answer generalizes most often.
    """
    head = [
        "method",
        "tasks",
        "seeds",
        "passes all five",
        "generalizes",
        "seconds, median",
        "95 %",
        "actions, median",
        "95 %",
    ]
    table = []
    for results in judged:
        for method, runs in results.by_method.items():
            answers = [answer for run in runs for answer in run.answers()]
            solved = [row["pairs_passed"] == EXAMPLES for row in answers]
            right = [row[GOAL] for row in answers]
            times = np.concatenate([run.column("seconds") for run in results.timed(method)])
            seconds = np.percentile(times, [50, 95])
            actions = np.percentile([row["simulated_actions"] for row in answers], [50, 95])
            cells = [f"{100 * np.mean(x):.1f} %" for x in (solved, right)]
            cells += [f"{x:.2f}" for x in seconds] + [f"{x:.0f}" for x in actions]
            cells = [name_of(method), str(len(runs[0].tasks)), str(len(runs)), *cells]
            table.append((np.mean(right), cells))
    return markdown_cells(head, [cells for _, cells in sorted(table, key=lambda row: -row[0])])


def noise_table(rows: Path, method: str) -> str:
    """Markdown: a method's one answer by the share of invalid pixels.

    Args:
        rows: a folder of files, one for each share.
        method: of which method.
    """
    table = []
    for share, results in sorted(Results.by_column(rows, "noise").items()):
        answers = results.first(method).answers()
        seconds = np.median([row["seconds"] for row in answers])
        table.append([f"{100 * share:.0f} %", str(len(answers)), *_shares(answers), f"{seconds:.2f}"])
    head = ["invalid pixels", "tasks", "passes all five", "generalizes", "seconds, median"]
    return markdown_cells(head, table)


def steps_table(results: Results, method: str) -> str:
    """Markdown: how often a method's answer passes and generalizes, by the steps of the task."""
    answers = results.first(method).answers()
    table = []
    for bucket in STEP_BUCKETS:
        there = [row for row in answers if step_bucket(row["steps"]) == bucket]
        table.append([bucket, str(len(there)), *_shares(there)])
    return markdown_cells(["steps", "tasks", "passes all five", "generalizes"], table)


def budget_table(
    answers: Mapping[str, Sequence[Row]], actions: Sequence[int], seconds: Sequence[float] = ()
) -> str:
    """Markdown: the shares of tasks with an answer that passes all five, and generalizes, within a budget.

    Args:
        answers: one for each task, by what is said of who gave them.
        actions: how many may have been simulated.
        seconds: how many it may have taken.
    """
    limits: list[tuple[str, float, str]] = [
        *(("simulated_actions", n, f"{n:,} actions") for n in actions),
        *(("seconds", s, f"{s:g} s") for s in seconds),
    ]
    table = [
        [name, str(len(given)), *(_shares_within(given, key, limit) for key, limit, _ in limits)]
        for name, given in answers.items()
    ]
    return markdown_cells(["within", "tasks", *(name for _, _, name in limits)], table)


def _shares_within(answers: Sequence[Row], key: str, limit: float) -> str:
    """Of the answers those that pass all five, and generalize, and have cost no more; in % of all."""
    in_time = [row["pairs_passed"] == EXAMPLES and row[key] <= limit for row in answers]
    right = [there and row[GOAL] for there, row in zip(in_time, answers, strict=True)]
    return f"{100 * np.mean(in_time):.1f} / {100 * np.mean(right):.1f}"


def confidence_table(results: Results, method: str) -> str:
    """Markdown: how often answers of a confidence generalize, of those that pass all five."""
    answers = [r for r in results.first(method).answers() if r["pairs_passed"] == EXAMPLES]
    table = []
    for low, high in ((0.0, 0.5), (0.5, 0.7), (0.7, 0.9), (0.9, 1.0), (1.0, 1.1)):
        there = [row for row in answers if low <= row["confidence"] + 1e-6 < high]
        name = "1" if low == 1.0 else f"{low} to {high}"
        table.append([name, str(len(there)), _shares(there)[1]])
    return markdown_cells(["confidence", "answers", "generalize"], table)


def _shares(answers: Sequence[Row]) -> tuple[str, str]:
    """Of the answers those that pass all five, and those that generalize; in %."""
    if not answers:
        return "", ""
    solved = np.mean([row["pairs_passed"] == EXAMPLES for row in answers])
    return f"{100 * solved:.1f} %", f"{100 * np.mean([row[GOAL] for row in answers]):.1f} %"
