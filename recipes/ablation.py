"""What EVAPS's parts are worth to the edits themselves, with and without the LSTM over its tokens.

    python -m recipes.ablation           # results/small/ablation.json
    python -m recipes.ablation --judge   # and rows of each, in results/small/methods/without-lstm

The first takes an hour and a half after `recipes.paper`.

The LSTM is no part of the paper: it tells every token of all others, which is what the graph is for. All
repairers learn from the same mistakes, and are judged by the log-likelihood of the edits of the same
held-out mistakes, which is less noisy than how many programs are right in the end; then once more with each
example's observations taken from another example, which is what they are worth to one that has learned to
look at them.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro
from jaxtyping import Float

from evaps.bootstrap import bootstrap
from evaps.models import METHODS, PROPOSER, load_method
from evaps.models.base import Execution, Repairer
from evaps.models.compute import device
from evaps.robots.workers import Workers
from evaps.synthesis.mistakes import Mistakes
from evaps.tasks.dataset import Dataset
from evaps.train import train
from evaps.train.repairers import find_mistakes, mistake_loss
from evaps.train.run import Run
from recipes.command import start
from recipes.paper import Plan, judge, make_checkpoint, make_data, with_what_is_needed
from recipes.result import write_result

ALONE = "-alone"
"""What is added to the name of a repairer without the LSTM."""
LOOKING = ("evaps-o", "evaps")


@dataclass(frozen=True)
class Ablation:
    """What is made."""

    methods: tuple[str, ...] = ("naive", "evaps-o", "evaps-s", "evaps")
    """Who is trained, with the LSTM and without; the others are compared with the first one."""
    seed: int = 2
    """Of the trainings, and of the mistakes."""
    judge: bool = False
    """Also judge each on the test tasks."""
    plan: Plan = field(default_factory=Plan)
    """Scale, workers and folders."""


def without_context(method: str) -> str:
    """Make a repairer's variant without the LSTM known, so that it can be trained and loaded by its name."""
    name = f"{method}{ALONE}"
    METHODS[name] = replace(METHODS[method], config={**METHODS[method].config, "context": False})
    return name


def likelihoods(model: Repairer, mistakes: Mistakes) -> Float[np.ndarray, " task"]:
    """For each task the log-likelihood of an edit, a mean over its mistakes, in nats."""
    table = torch.from_numpy(mistakes.table).to(device())
    with torch.inference_mode():
        each = [-mistake_loss(model, mistakes, [row], table).item() for row in range(len(mistakes.targets))]
    of_task: dict[int, list[float]] = {}
    for task, value in zip(mistakes.tasks, each, strict=True):
        of_task.setdefault(task, []).append(value)
    return np.array([np.mean(values) for values in of_task.values()])


def looking_elsewhere(mistakes: Mistakes) -> Mistakes:
    """Each example with what was seen in the one before it, before, after and at the end; goals stay."""

    def moved(execution: Execution) -> Execution:
        seen: dict[str, Any] = {
            key: np.roll(getattr(execution, key), 1, axis=0) for key in ("before", "after", "final")
        }
        return replace(execution, **seen)

    return replace(mistakes, executions=[moved(execution) for execution in mistakes.executions])


def compared(better: Float[np.ndarray, " task"], worse: Float[np.ndarray, " task"]) -> dict[str, float]:
    """How much more likely the one makes an edit than the other, in nats, with a 95 % interval over tasks."""
    return {key: round(value, 4) for key, value in bootstrap((better - worse)[None])._asdict().items()}


def trained(ablation: Ablation, methods: Sequence[str]) -> Path:
    """The folder of the checkpoints of these methods, which are trained if they are not there."""
    plan, seed = ablation.plan, ablation.seed
    make_data(plan)
    for needed in with_what_is_needed((PROPOSER,)):
        make_checkpoint(plan, seed, needed)
    for method in methods:  # a shipped one has learned from other mistakes, and is not taken
        if not (plan.runs(seed) / method / "config.json").exists():
            train(method, plan.data, plan.runs(seed), plan.scale, seed, Workers(plan.workers))
    return plan.runs(seed)


def make_rows(ablation: Ablation, runs: Path, methods: Sequence[str]) -> None:
    """Rows of these methods in a folder of their own, in this process, which alone knows all of them."""
    alone = replace(ablation.plan, workers=0)
    for method in methods:
        name = f"{method}-{ablation.seed}.parquet"
        judge(alone, runs, (method,), alone.results / "methods" / "without-lstm" / name)


def main(ablation: Ablation) -> None:
    """Train, and write what was found."""
    variants = [name for m in ablation.methods for name in (m, without_context(m))]
    runs = trained(ablation, variants)
    if ablation.judge:
        make_rows(ablation, runs, variants)
    run = Run(Dataset(ablation.plan.data), runs, ablation.plan.scale, ablation.seed, Workers(0))
    held = find_mistakes(run, "validation")
    elsewhere = looking_elsewhere(held)
    found: dict[str, Any] = {}
    usual: dict[str, Float[np.ndarray, " task"]] = {}
    for name in variants:
        model = load_method(runs / name, name)
        assert isinstance(model, Repairer)
        model = model.to(device()).eval()
        usual[name] = likelihoods(model, held)
        base = f"{ablation.methods[0]}{ALONE if name.endswith(ALONE) else ''}"
        found[name] = {"likelihood": round(float(usual[name].mean()), 4)}
        if name != base:
            found[name][f"more than {base}"] = compared(usual[name], usual[base])
        if name.endswith(ALONE):
            found[name]["less than with the LSTM"] = compared(usual[name.removesuffix(ALONE)], usual[name])
        if name.removesuffix(ALONE) in LOOKING:
            found[name]["lost with another example's observations"] = compared(
                usual[name], likelihoods(model, elsewhere)
            )
    facts = {"seed": ablation.seed, "held-out mistakes": len(held.targets), "tasks": len(usual[variants[0]])}
    write_result(ablation.plan.results / "ablation.json", {**facts, "repairers": found})
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    start(lambda: main(tyro.cli(Ablation, description=__doc__)))
