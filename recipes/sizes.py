"""What more training data is worth: the same methods, trained on the first tasks of the data set, or on more.

    python -m recipes.sizes   # results/small/methods/sizes/; four hours after `recipes.paper`
    python -m recipes.sizes --sizes 50000

A task depends on the data set's seed and its index alone, so a smaller data set is the beginning of a larger
one, with the same test tasks first. All have the same number of batches. Encoder and inverse model are those
of the usual size: they learn from random walks, which anybody can have.
"""

from __future__ import annotations

import shutil
from dataclasses import dataclass, field
from pathlib import Path

import tyro

from evaps.models import PROPOSER
from evaps.report import SIZES, report
from evaps.robots.workers import Workers
from evaps.tasks.build import generate
from evaps.train import train
from recipes.command import start
from recipes.paper import (
    DATA_SEED,
    SHARED,
    Plan,
    judge,
    make_checkpoint,
    make_data,
    rows_path,
    take,
    with_what_is_needed,
)


@dataclass(frozen=True)
class Sizes:
    """What is made."""

    sizes: tuple[int, ...] = (2_500, 5_000, 10_000, 50_000)
    """Tasks in the other data sets; 70 % of them are for training."""
    methods: tuple[str, ...] = (PROPOSER,)
    """Who is trained on them; the whole data set's checkpoints are judged beside them."""
    plan: Plan = field(default_factory=Plan)
    """Scale, test tasks and folders."""


def make_rows(plan: Plan, tasks: int, method: str) -> None:
    """Rows of a method that is trained on so many tasks, if they are not there."""
    path = rows_of(plan, method, str(tasks))
    if path.exists():
        return
    make_data(plan)
    for name in SHARED:
        make_checkpoint(plan, 0, name)
    data, runs = plan.root / "data" / f"{plan.scale}-{tasks}", Path(f"{plan.runs(0)}-{tasks}")
    generate(data, tasks, DATA_SEED, Workers(plan.workers))
    for name in with_what_is_needed((method,)):
        if name in SHARED:
            take(plan.runs(0) / name, runs / name)
        elif not (runs / name / "config.json").exists():
            train(name, data, runs, plan.scale, 0, Workers(plan.workers))
    judge(plan, runs, (method,), path)


def rows_of(plan: Plan, method: str, tasks: str) -> Path:
    """The file of a method's rows."""
    return plan.results / "methods" / "sizes" / f"{method}-0-{tasks}.parquet"


def main(sizes: Sizes) -> None:
    """Everything, going on where it was interrupted, and the figure."""
    plan = sizes.plan
    for method in sizes.methods:
        for tasks in sizes.sizes:
            make_rows(plan, tasks, method)
        whole = rows_path(plan, 0, method)
        if not whole.exists():
            make_data(plan)
            for name in with_what_is_needed((method,)):
                make_checkpoint(plan, 0, name)
            judge(plan, plan.runs(0), (method,), whole)
        shutil.copy(whole, rows_of(plan, method, "all"))
    report(SIZES, plan.results / "methods", plan.results / "report")


if __name__ == "__main__":
    start(lambda: main(tyro.cli(Sizes, description=__doc__)))
