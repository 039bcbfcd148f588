"""The gallery: test tasks picked at random, what each method answers there, and what became of it.

    python -m recipes.gallery   # results/small/gallery.html; five minutes after the data

The tasks are drawn by seed, not by success. An answer is a method's first candidate of those that pass most
examples; beside it stands whether it generalizes, and the hidden program, which no method sees.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
import tyro

from evaps.evaluate import match
from evaps.models import Model, load_model
from evaps.report.names import name_of
from evaps.robots.base import Robot
from evaps.synthesis import Budget, memo_of, solve, team_of_robots
from evaps.tasks.dataset import Dataset, gold_task
from evaps.tasks.task import GoldTask
from evaps.viewer import TaskReport, write_page
from recipes.paper import Plan, make_data

LEAD = (
    "{} test tasks, drawn by a seed ({}) and not by success, with the answer of each method: its first "
    "candidate of those that pass most of the five examples. Beside it stand whether the answer also does "
    "what was meant on a sixth scene, and the hidden program, which no method has seen."
)


@dataclass(frozen=True)
class Gallery:
    """What is shown."""

    tasks: int = 20
    """How many test tasks."""
    seed: int = 0
    """Of the draw."""
    methods: tuple[str, ...] = ("lgrl", "evaps", "verified")
    """Who answers; each needs its checkpoints in the model."""
    model: str = "small"
    """A shipped set of checkpoints, or a folder of them."""
    out: Path = Path("results/small/gallery.html")
    """The page."""


def drawn(dataset: Dataset, tasks: int, seed: int) -> Iterator[GoldTask]:
    """Test tasks at random, with their answers."""
    test = dataset.split("test")
    chosen = np.random.default_rng(seed).choice(test, min(tasks, len(test)), replace=False).tolist()
    for position, frames in dataset.frames(sorted(chosen)):
        yield gold_task(dataset.rows[position], frames)


def answers(gold: GoldTask, models: Mapping[str, Model], robots: Sequence[Robot]) -> Iterator[TaskReport]:
    """Each method's answer to a task, from a robot that remembers nothing."""
    for method, model in models.items():
        memo = memo_of(robots)
        solution = solve(model, gold.task, memo, budget=Budget(seconds=math.inf))
        found = match(solution.program, gold, memo)
        notes = {
            "Sixth scene, too": "generalizes" if found.generalization_state else "does not generalize",
            "Hidden program": str(gold.program),
        }
        memo.leave()
        shown = replace(solution, candidates=solution.candidates[:1])
        yield TaskReport(replace(gold.task, name=f"{gold.name}, {name_of(method)}"), shown, notes)


def main(gallery: Gallery) -> None:
    """Answer, and write the page."""
    torch.set_num_threads(1)
    plan = Plan()
    make_data(plan)
    robots = team_of_robots()
    models = {method: load_model(gallery.model, method) for method in gallery.methods}
    reports = [
        report
        for gold in drawn(Dataset(plan.data), gallery.tasks, gallery.seed)
        for report in answers(gold, models, robots)
    ]
    write_page(gallery.out, reports, "Gallery", [LEAD.format(gallery.tasks, gallery.seed)], lossy=True)
    for robot in robots:
        robot.close()
    print(gallery.out)


if __name__ == "__main__":
    main(tyro.cli(Gallery))
