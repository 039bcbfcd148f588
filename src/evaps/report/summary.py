"""Short tables that compare methods, for pages and the terminal, from evaluation rows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from evaps.bootstrap import bootstrap
from evaps.dsl import UserError
from evaps.metrics import METRICS, TITLES, TOP, MethodResults, Results
from evaps.report.names import name_of
from evaps.report.paper import GENERALIZATION
from evaps.report.table import markdown_cells
from evaps.report.wording import GOAL
from evaps.tasks.files import read_json_lines


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
    for method in best_first(results):
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


def seeds_table(results: Results) -> str:
    """Markdown: for each method and seed which share generalizes at top-1 / 5 / 20, in %."""
    seeds = sorted({run.seed for run in results.each()})
    table = []
    for method in best_first(results):
        shares = {
            run.seed: [100 * run.matches(GOAL, k).mean() for k in TOP] for run in results.by_method[method]
        }
        cells = [" / ".join(f"{share:.1f}" for share in shares.get(seed, ())) for seed in seeds]
        table.append([name_of(method), *cells])
    return markdown_cells(["method", *(f"seed {seed}" for seed in seeds)], table)


def best_first(results: Results) -> list[str]:
    """The methods, first the one whose first program generalizes most often."""
    return sorted(results.methods, key=lambda method: -results.top(method, GOAL, 1).mean())


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


def gains_of_scale(smaller: Results, larger: Results) -> str:
    """Markdown: generalization of methods at two scales, and what the larger one gains on the same tasks.

    The differences are in points, with 95 % intervals of a paired bootstrap over the tasks.

    Args:
        smaller: results of all methods in ``larger``; a method's first seed counts.
        larger: of the same tasks.

    Raises:
        UserError: they were judged on other tasks, or computed in another precision.
    """
    table = []
    for method in best_first(larger):
        before, after = smaller.first(method), larger.first(method)
        _check_comparable(before, after)
        shares = [f"{100 * before.matches(GOAL, k).mean():.1f}" for k in TOP]
        gains = [_change(before, after, k) for k in TOP]
        for run, cells in ((before, shares), (after, gains)):
            table.append([name_of(method), f"{run.fact('trained_on'):,}", *cells])
    return markdown_cells(["method", "tasks in the data set", *(f"@{k}" for k in TOP)], table)


def _check_comparable(one: MethodResults, other: MethodResults) -> None:
    """In another precision a synthesizer proposes other programs: that would be taken for noise."""
    precisions = {run.answers()[0].get("machine", "").rpartition(", ")[2] for run in (one, other)}
    if one.tasks != other.tasks or len(precisions) > 1:
        raise UserError(f"rows of {one.method} that are compared differ in tasks or in precision")


def _change(before: MethodResults, after: MethodResults, k: int) -> str:
    """How many of the tasks it solves among ``k`` candidates, and how many points more or less that is."""
    was, now = (100.0 * run.matches(GOAL, k) for run in (before, after))
    gain = bootstrap((now - was)[None])
    return f"{now.mean():.1f} ({gain})"


def bench_table(rows: Path) -> str:
    """The figures of ``evaps bench`` as Markdown, from the file that its ``--out`` wrote."""
    figures = read_json_lines(rows)
    table = [[f["name"], f"{f['value']:.4g} {f['unit']}", f["target"]] for f in figures]
    return markdown_cells(["what", "measured", "target"], table)
