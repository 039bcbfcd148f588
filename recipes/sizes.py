"""What more training data is worth: the same methods, trained on the first tasks of the data set only.

    python -m recipes.sizes   # results/small/methods/sizes/; an hour and a half after `recipes.paper`

A task depends on the data set's seed and its index alone, so a smaller data set is the beginning of a larger
one. Encoder and inverse model are those of the whole: they learn from random walks, which anybody can have.
"""

from __future__ import annotations

import shutil
from dataclasses import dataclass, field, replace
from pathlib import Path

import tyro

from evaps.evaluate import evaluate
from evaps.models import PROPOSER, needed_for
from evaps.report import SIZES, report
from evaps.robots.workers import Workers
from evaps.tasks.build import generate
from evaps.train import train
from recipes.paper import DATA_SEED, Plan, make_checkpoint, make_data


@dataclass(frozen=True)
class Sizes:
    """What is made."""

    sizes: tuple[int, ...] = (2_500, 5_000, 10_000)
    """Tasks in the smaller data sets; 70 % of them are for training."""
    methods: tuple[str, ...] = (PROPOSER,)
    """Who is trained on them; the whole data set's checkpoints are judged beside them."""
    plan: Plan = field(default_factory=Plan)
    """Scale, test tasks and folders."""


def make_rows(sizes: Sizes, tasks: int | None, method: str) -> None:
    """Rows of a method that was trained on the first ``tasks`` of the data set; None for all of them."""
    plan = sizes.plan
    runs = plan.runs(0)
    if tasks is not None:
        data, runs = plan.root / "data" / f"{plan.scale}-{tasks}", Path(f"{runs}-{tasks}")
        generate(data, tasks, DATA_SEED, Workers(plan.workers))
        for name in ("encoder", "inverse"):
            shutil.copytree(plan.runs(0) / name, runs / name, dirs_exist_ok=True)
        for name in dict.fromkeys((*needed_for(method), method)):
            if not (runs / name / "config.json").exists():
                train(name, data, runs, plan.scale, 0, Workers(plan.workers))
    out = plan.results / "methods" / "sizes" / f"{method}-0-{tasks or 'all'}.parquet"
    out.parent.mkdir(parents=True, exist_ok=True)
    if not out.exists():
        evaluate(plan.data, out, str(runs), (method,), tasks=plan.tasks, workers=Workers(plan.workers))


def main(sizes: Sizes) -> None:
    """Everything, going on where it was interrupted, and the figure."""
    plan = replace(sizes.plan, methods=sizes.methods)
    make_data(plan)
    for name in dict.fromkeys(n for m in sizes.methods for n in ("encoder", "inverse", *needed_for(m))):
        make_checkpoint(plan, 0, name)
    for method in sizes.methods:
        for tasks in (*sizes.sizes, None):
            make_rows(sizes, tasks, method)
    report(SIZES, plan.results / "methods", plan.results / "report")


if __name__ == "__main__":
    main(tyro.cli(Sizes))
