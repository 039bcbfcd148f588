"""Figures over something that grows: candidates, budgets, training."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np

from evaps.metrics import TOP, MethodResults, Results, bootstrap
from evaps.report.figure import Figure, Line
from evaps.report.names import name_of
from evaps.tasks.files import read_text
from evaps.tasks.info import STEP_BUCKETS
from evaps.tasks.task import EXAMPLES

MOST = 20
BAND_DRAWS = 1_000


def complexity(results: Results) -> Figure:
    """Generalization among the first 1 to 20 candidates, for tasks of so many steps."""
    panels = {}
    for bucket, name in enumerate(STEP_BUCKETS):
        lines = {}
        for method, runs in results.by_method.items():
            there = [np.clip(run.column("steps"), 2, 7) - 2 == bucket for run in runs]
            if all(chosen.any() for chosen in there):
                shares = [
                    np.mean([100 * _right(run, k)[c].mean() for run, c in zip(runs, there, strict=True)])
                    for k in range(1, MOST + 1)
                ]
                lines[name_of(method)] = Line(range(1, MOST + 1), shares)
        panels[f"{name} steps"] = lines
    return Figure(panels, "candidates", "generalization (%)")


def candidates(results: Results) -> Figure:
    """Generalization among the first 1 to 20 candidates, with 95 % intervals."""
    return Figure({"all tasks": _bands(results, results.methods)}, "candidates", "generalization (%)")


def _bands(results: Results, methods: Collection[str]) -> dict[str, Line]:
    lines = {}
    for method, runs in results.by_method.items():
        if method not in methods:
            continue
        found = [
            bootstrap(np.stack([100.0 * _right(run, k) for run in runs]), draws=BAND_DRAWS)
            for k in range(1, MOST + 1)
        ]
        means, lows, highs = zip(*found, strict=True)
        lines[name_of(method)] = Line(range(1, MOST + 1), means, lows, highs)
    return lines


def _right(run: MethodResults, k: int) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    return run.matches("generalization_state", k)


def noise(clean: Results, by_share: Mapping[float, Results]) -> Figure:
    """Generalization among the first 1 to 20 candidates, a panel for each share of invalid pixels.

    Args:
        clean: the results without noise; of these the tasks that were judged with noise.
        by_share: those with noise; a method without any is left out.
    """
    judged = {method for results in by_share.values() for method in results.methods}
    tasks = {t for results in by_share.values() for run in results.each() for t in run.tasks}
    panels = {}
    for share, results in {0.0: clean.of_tasks(tasks), **dict(sorted(by_share.items()))}.items():
        panels[f"{100 * share:.0f} % of the pixels invalid"] = _bands(results, judged)
    return Figure(panels, "candidates", "generalization (%)")


def sizes(by_tasks: Mapping[float, Results]) -> Figure:
    """Generalization of the first 1, 5 and 20 candidates, against the tasks of the data set trained on.

    Args:
        by_tasks: the results, by how many tasks the data set had (all splits together).
    """
    panels: dict[str, dict[str, Line]] = {f"top-{k}": {} for k in TOP}
    for method in dict.fromkeys(m for results in by_tasks.values() for m in results.methods):
        there = {tasks: results for tasks, results in by_tasks.items() if method in results.methods}
        for k in TOP:
            means = [float(r.top(method, "generalization_state", k).mean()) for r in there.values()]
            panels[f"top-{k}"][name_of(method)] = Line(list(there), means)
    return Figure(panels, "tasks in the data set", "generalization (%)", log=True)


def actions(results: Results) -> Figure:
    """How many tasks have an answer that passes and generalizes, against the actions that were simulated."""
    return _budget(results, "simulated_actions", np.geomspace(10, 10_000, 25), "simulated actions")


def seconds(results: Results) -> Figure:
    """How many tasks have an answer that passes and generalizes, against the seconds that it took."""
    return _budget(results, "seconds", np.geomspace(0.1, 100, 25), "seconds")


def _budget(
    results: Results, key: str, limits: np.ndarray[tuple[int], np.dtype[np.float64]], name: str
) -> Figure:
    lines = {}
    for method in results.methods:
        answers = [row for run in results.by_method[method] for row in run.answers()]
        right = np.array([r["pairs_passed"] == EXAMPLES and r["generalization_state"] for r in answers])
        cost = np.array([r[key] for r in answers])
        shares = [100 * float((right & (cost <= limit)).mean()) for limit in limits]
        lines[name_of(method)] = Line(limits.tolist(), shares)
    return Figure({"answers": lines}, name, "answers that generalize (%)", log=True)


def learning(folder: Path) -> Figure:
    """Validation against batches, from the metrics of trainings, ``METHOD-SEED.jsonl``.

    Args:
        folder: of these files.
    """
    files = sorted(folder.glob("*-*.jsonl"))
    trainings = Counter(path.stem.rpartition("-")[0] for path in files)
    loss: dict[str, Line] = {}
    solved: dict[str, Line] = {}
    for path in files:
        method, _, seed = path.stem.rpartition("-")
        rows = [json.loads(line) for line in read_text(path).splitlines()]
        found = [row for row in rows if "validation_solved" in row]
        label = name_of(method) + (f", seed {seed}" if trainings[method] > 1 else "")
        if found:
            steps = [row["step"] for row in found]
            loss[label] = Line(steps, [row["validation_loss"] for row in found])
            solved[label] = Line(steps, [100 * row["validation_solved"] for row in found])
    panels = {"loss": loss, "solved by the first four programs (%)": solved}
    return Figure(panels, "batches", "validation", share_y=False)
