"""Short tables for pages and the terminal, from evaluation rows."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from evaps.bootstrap import bootstrap
from evaps.dsl import UserError
from evaps.metrics import METRICS, TITLES, TOP, MethodResults, Results, Row
from evaps.report.names import name_of
from evaps.report.paper import GENERALIZATION
from evaps.report.table import markdown_cells
from evaps.report.wording import GOAL
from evaps.tasks.info import STEP_BUCKETS, step_bucket
from evaps.tasks.task import EXAMPLES


def summary_table(results: Results, beside_paper: bool = False) -> str:
    """Markdown: for each method the metrics at top-1 / 5 / 20 and its answer in %, and its cost a task.

    Means over seeds; how many there are stands there where a method has several. Seconds are of the seeds
    that were judged on the usual machine (`Results.timed`). First comes whose first program generalizes most
    often.

    Args:
        results: of which methods.
        beside_paper: whether there is a column of what the paper reports.
    """
    several = any(len(runs) > 1 for runs in results.by_method.values())
    paper = ["generalization in the paper"] if beside_paper else []
    costs = ["answer", "seconds", "simulated actions"]
    head = ["method", *["seeds"] * several, *(TITLES[m] for m in METRICS), *paper, *costs]
    table = []
    for method in sorted(results.methods, key=lambda m: -results.top(m, GOAL, 1).mean()):
        runs = results.by_method[method]
        cells = [name_of(method), *[str(len(runs))] * several]
        cells += [" / ".join(_mean(results.top(method, m, k)) for k in TOP) for m in METRICS]
        if beside_paper:
            cells.append(" / ".join(f"{share:.1f}" for share in GENERALIZATION.get(method, ())))
        answered, seconds, actions = _answers_and_costs(results, method)
        table.append([*cells, f"{100 * answered:.1f}", f"{seconds:.2f}", f"{actions:.0f}"])
    return markdown_cells(head, table)


def _mean(values: Float[np.ndarray, " seed"]) -> str:
    """A dash where there were not so many candidates."""
    return "-" if np.isnan(values).any() else f"{values.mean():.1f}"


def _answers_and_costs(results: Results, method: str) -> tuple[float, float, float]:
    """The share of answers that generalize, and a task's seconds and simulated actions; means."""
    runs = results.by_method[method]
    answered = np.mean([run.answered().mean() for run in runs])
    seconds = np.mean([run.column("seconds").mean() for run in results.timed(method)])
    actions = np.mean([run.column("simulated_actions").mean() for run in runs])
    return float(answered), float(seconds), float(actions)


def lead_table(results: Results, method: str, ks: Sequence[int] = (min(TOP), max(TOP))) -> str:
    """Markdown: by how many points a method is ahead of each other one, with 95 % intervals.

    Where the interval leaves no doubt that there is a difference, it is in bold. The other methods stand in
    the order of that lead; one that was not judged on the same tasks with the same seeds has no row.

    Args:
        results: of all of them.
        method: whose lead.
        ks: among how many candidates generalization is compared.
    """
    leads = []
    for other in results.methods:
        try:
            leads.append((results.differences(method, other, GOAL, ks), other))
        except ValueError:
            continue
    table = [
        [name_of(other), str(len(results.shared_seeds(method, other)))]
        + [f"**{found}**" if found.certain else str(found) for found in lead]
        for lead, other in sorted(leads)
        if other != method
    ]
    return markdown_cells([f"{name_of(method)} against", "seeds", *(f"@{k}" for k in ks)], table)


def summary_values(results: Results) -> list[dict[str, Any]]:
    """The same as `summary_table` as JSON values: shares from 0 to 1, and means a task.

    A share among more candidates than were asked for is None.
    """
    found = []
    for method, runs in results.by_method.items():
        values: dict[str, Any] = {"method": method, "tasks": len(runs[0].tasks), "seeds": len(runs)}
        for metric in METRICS:
            for k in TOP:
                share = float(results.top(method, metric, k).mean()) / 100
                values[f"{TITLES[metric]}@{k}"] = None if np.isnan(share) else share
        values |= zip(
            ("answer", "seconds", "simulated_actions"), _answers_and_costs(results, method), strict=True
        )
        found.append(values)
    return found


def answer_table(rows: Sequence[Path]) -> str:
    """Markdown: the one answer of each method that the files have rows of, of all seeds, and its cost.

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
    for path in rows:
        results = Results.read(path)
        for method, runs in results.by_method.items():
            answers = [answer for run in runs for answer in run.answers()]
            solved = [row["pairs_passed"] == EXAMPLES for row in answers]
            right = [row["generalization_state"] for row in answers]
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


def noise_costs(rows: Path) -> str:
    """Markdown: generalization by the share of invalid pixels, and what that share costs on the same tasks.

    The differences are in points, with 95 % intervals of a paired bootstrap over the tasks.

    Args:
        rows: a folder of files, one for each method and share, 0 among them; a method's first seed counts.

    Raises:
        UserError: there are no rows without noise, or they were computed in another precision.
    """
    by_share = Results.by_column(rows, "noise")
    clean = by_share.pop(0.0, None)
    table = []
    for method in dict.fromkeys(method for results in by_share.values() for method in results.methods):
        if clean is None or method not in clean.methods:
            raise UserError(f"{rows} has no rows of {method} without noise to compare with")
        whole = clean.first(method)
        for share, results in sorted(by_share.items()):
            if method in results.methods:
                run = results.first(method)
                _check_comparable(whole, run)
                name = [name_of(method), f"{100 * share:.0f} %", str(len(run.tasks))]
                table.append([*name, *(_change(whole, run, k) for k in TOP)])
    return markdown_cells(["method", "invalid pixels", "tasks", *(f"@{k}" for k in TOP)], table)


def _check_comparable(one: MethodResults, other: MethodResults) -> None:
    """In another precision a synthesizer proposes other programs: that would be taken for noise."""
    precisions = {run.answers()[0].get("machine", "").rpartition(", ")[2] for run in (one, other)}
    if one.tasks != other.tasks or len(precisions) > 1:
        raise UserError(f"rows of {one.method} with and without noise differ in tasks or in precision")


def _change(before: MethodResults, after: MethodResults, k: int) -> str:
    """How many of the tasks it solves among ``k`` candidates, and how many points more or less that is."""
    was, now = (100.0 * run.matches(GOAL, k) for run in (before, after))
    gain = bootstrap((now - was)[None])
    return f"{now.mean():.1f} ({gain})"


def steps_table(rows: Path, method: str) -> str:
    """Markdown: how often a method's answer passes and generalizes, by the steps of the task."""
    answers = Results.read(rows).first(method).answers()
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
    right = [there and row["generalization_state"] for there, row in zip(in_time, answers, strict=True)]
    return f"{100 * np.mean(in_time):.1f} / {100 * np.mean(right):.1f}"


def confidence_table(rows: Path, method: str) -> str:
    """Markdown: how often answers of a confidence generalize, of those that pass all five."""
    answers = [r for r in Results.read(rows).first(method).answers() if r["pairs_passed"] == EXAMPLES]
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
    return f"{100 * solved:.1f} %", f"{100 * np.mean([row['generalization_state'] for row in answers]):.1f} %"


def bench_table(rows: Path) -> str:
    """The figures of ``evaps bench`` as Markdown, from the file that its ``--out`` wrote."""
    figures = [json.loads(line) for line in rows.read_text().splitlines()]
    table = [[f["name"], f"{f['value']:.4g} {f['unit']}", f["target"]] for f in figures]
    return markdown_cells(["what", "measured", "target"], table)
