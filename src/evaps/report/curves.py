"""Figures over something that grows: candidates, budgets, training."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from evaps.bootstrap import bootstrap, bootstraps
from evaps.metrics import TOP, MethodResults, Results
from evaps.report.figure import Figure, Line
from evaps.report.names import name_of
from evaps.report.paper import PAPER
from evaps.report.wording import GOAL, scale_note
from evaps.tasks.files import read_json_lines
from evaps.tasks.info import STEP_BUCKETS, step_bucket
from evaps.tasks.task import EXAMPLES

MOST = 20
BAND_DRAWS = 1_000
LEARNED = (
    ("loss of a token", "validation_loss", 1.0),
    ("solved by the first four programs (%)", "validation_solved", 100.0),
    ("log-likelihood of an edit", "validation_likelihood", 1.0),
    ("failures that one repair mends (%)", "validation_semantic", 100.0),
)
"""What is shown of trainings: a panel's title, a metric, and what it is multiplied with."""


def complexity(results: Results) -> Figure:
    """Generalization among the first 1 to 20 candidates, for tasks of so many steps."""
    panels = {}
    tasks = Counter(_buckets(next(results.each())).tolist())
    for bucket in STEP_BUCKETS:
        lines = {}
        for method, runs in results.by_method.items():
            there = [_buckets(run) == bucket for run in runs]
            if all(chosen.any() for chosen in there):
                shares = [
                    np.mean([100 * _right(run, k)[c].mean() for run, c in zip(runs, there, strict=True)])
                    for k in _asked(runs)
                ]
                lines[name_of(method)] = Line(_asked(runs), shares)
        panels[f"{bucket} steps ({tasks[bucket]} tasks)"] = lines
    notes = ["The paper shows its figure without numbers."]
    return Figure(panels, "candidates", "generalization (%)", notes=notes)


def _buckets(run: MethodResults) -> np.ndarray[tuple[int], np.dtype[np.str_]]:
    """For each task in which of STEP_BUCKETS it is."""
    return np.array([step_bucket(steps) for steps in run.column("steps")])


def candidates(results: Results) -> Figure:
    """Generalization among the first 1 to 20 candidates, with 95 % intervals."""
    return Figure({"all tasks": _bands(results)}, "candidates", "generalization (%)")


def _bands(results: Results) -> dict[str, Line]:
    lines = {}
    for method, runs in results.by_method.items():
        ks = _asked(runs)
        found = bootstraps(np.array([_solved(runs, k) for k in ks]), draws=BAND_DRAWS)
        means, lows, highs = zip(*found, strict=True)
        lines[name_of(method)] = Line(ks, means, lows, highs)
    return lines


def _solved(runs: Sequence[MethodResults], k: int) -> Float[np.ndarray, "seed task"]:
    return np.array([100.0 * _right(run, k) for run in runs])


def _asked(runs: Sequence[MethodResults]) -> range:
    """The numbers of candidates that can be looked at."""
    return range(1, int(min(MOST, *(run.asked for run in runs))) + 1)


def _right(run: MethodResults, k: int) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    return run.matches(GOAL, k)


def noise(by_share: Mapping[float, Results]) -> Figure:
    """Generalization among the first 1 to 20 candidates, a panel for each share of invalid pixels.

    Args:
        by_share: the results by that share, on the same tasks; without noise, too, since another machine or
            precision has other candidates.
    """
    panels = {
        f"{100 * share:.0f} % of the pixels invalid": _bands(results)
        for share, results in sorted(by_share.items())
    }
    notes = [scale_note(next(iter(by_share.values()))), "Noise costs the paper's EVAPS up to 7.5 points."]
    return Figure(panels, "candidates", "generalization (%)", notes=notes)


def sizes(by_tasks: Mapping[float, Results]) -> Figure:
    """Generalization of the first 1, 5 and 20 candidates, against the tasks of the data set trained on.

    Args:
        by_tasks: the results, by how many tasks the data set had (all splits together).
    """
    panels: dict[str, dict[str, Line]] = {f"top-{k}": {} for k in TOP}
    for method in dict.fromkeys(m for results in by_tasks.values() for m in results.methods):
        there = {tasks: r.by_method[method] for tasks, r in by_tasks.items() if method in r.methods}
        for k in TOP:
            found = [bootstrap(_solved(runs, k), draws=BAND_DRAWS) for runs in there.values()]
            means, lows, highs = zip(*found, strict=True)
            panels[f"top-{k}"][name_of(method)] = Line(list(there), means, lows, highs)
    notes = [
        f"70 % of these tasks are trained on; 95 % intervals. {_machines(*by_tasks.values())}",
        f"The paper: {PAPER}.",
    ]
    return Figure(panels, "tasks in the data set", "generalization (%)", log=True, notes=notes)


CHARGED = (
    "Who proposes candidates is charged for all of them and their repairs, a search until it ends; draws "
    "from the prior are twenty programs, blind search goes on drawing."
)


def actions(results: Results) -> Figure:
    """How many tasks have an answer that passes and generalizes, against the actions that were simulated."""
    limits = np.geomspace(10, 10_000, 25)
    return _budget(results, "simulated_actions", limits, "simulated actions", [CHARGED])


def seconds(results: Results) -> Figure:
    """How many tasks have an answer that passes and generalizes, against the seconds that it took."""
    machines = (
        "Seconds of different ones do not compare: of each method only the seeds on the usual one count."
    )
    notes = [CHARGED, f"{_machines(results)} {machines}"]
    return _budget(results, "seconds", np.geomspace(0.1, 100, 25), "seconds", notes)


def _machines(*each: Results) -> str:
    machines = {str(run.fact("machine")) for results in each for run in results.each()}
    return f"Judged on: {'; '.join(sorted(machines))}."


def _budget(
    results: Results, key: str, limits: Float[np.ndarray, " limit"], name: str, notes: Sequence[str]
) -> Figure:
    lines = {}
    most = max(len(run.tasks) for run in results.each())
    for method, runs in results.by_method.items():
        answers = [r for run in (results.timed(method) if key == "seconds" else runs) for r in run.answers()]
        right = np.array([r["pairs_passed"] == EXAMPLES and r[GOAL] for r in answers])
        cost = np.array([r[key] for r in answers])
        shares = [100 * float((right & (cost <= limit)).mean()) for limit in limits]
        fewer = f" ({len(runs[0].tasks)} tasks)" if len(runs[0].tasks) < most else ""
        lines[name_of(method) + fewer] = Line(limits.tolist(), shares, of=name_of(method))
    return Figure({"answers": lines}, name, "answers that generalize (%)", log=True, notes=notes)


def learning(folder: Path) -> Figure:
    """Validation against batches, from the metrics of trainings, ``METHOD-SEED.jsonl``.

    Args:
        folder: of these files.
    """
    files = sorted(folder.glob("*-*.jsonl"))
    trainings = Counter(path.stem.rpartition("-")[0] for path in files)
    panels: dict[str, dict[str, Line]] = {title: {} for title, _, _ in LEARNED}
    for path in files:
        method, _, seed = path.stem.rpartition("-")
        rows = read_json_lines(path)
        name = name_of(method)
        label = name + (f", seed {seed}" if trainings[method] > 1 else "")
        for title, key, factor in LEARNED:
            if found := [row for row in rows if key in row and _belongs(method, row, key)]:
                batches = [row["step"] + 1 for row in found]
                values = [factor * row[key] for row in found]
                dashes = int(seed) if seed.isdigit() else 0
                panels[title][label] = Line(batches, values, of=name, dashes=dashes)
    there = {title: lines for title, lines in panels.items() if lines}
    scale = f"The paper, which shows no such figure: {PAPER}."
    notes = ["A line is one training; only those are here whose curve was kept.", scale]
    return Figure(there, "batches", "validation", alike=False, notes=notes)


def _belongs(method: str, row: Mapping[str, float], key: str) -> bool:
    """Whether methods with this metric mean the same by it.

    Synthesizers and repairers both know semantic matches, of different things; who makes all edits at once
    has a likelihood of all of them together.
    """
    if key == "validation_likelihood":
        return method != "evaps-parallel"
    return key != "validation_semantic" or "validation_likelihood" in row
