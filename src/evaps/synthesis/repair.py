"""The paper's loop: run each candidate, repair it with what the robot saw, and run it again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import torch

from evaps.dsl import Program
from evaps.models import Model
from evaps.models.base import Repairer, Synthesizer
from evaps.models.beam import Proposal, beam_search
from evaps.models.compute import autocast
from evaps.models.inferred_trace import InferredTrace
from evaps.robots.memo import MemoRobot
from evaps.synthesis.budget import Meter
from evaps.synthesis.features import FeatureTable
from evaps.synthesis.solution import Attempt, Candidate, Solution, attempt_all, best_first
from evaps.synthesis.watch import NOBODY, News, Watch
from evaps.synthesis.ways import WayTable, follow
from evaps.tasks.task import Task

ROUNDS = 5
BEAM = 32  # Bunel et al. decode with 64; on two cores half of it must do


def propose(
    model: Model, table: FeatureTable, task: Task, robot: MemoRobot, beam: int = BEAM
) -> list[Proposal]:
    """The synthesizer's programs for a task, most probable first."""
    with autocast():
        return beam_search(model.synthesizer, _given(model.synthesizer, table, task, robot), beam)[0]


def _given(synthesizer: Synthesizer, table: FeatureTable, task: Task, robot: MemoRobot) -> Any:
    """What the synthesizer is told: the features of the pairs, or the ways that it went."""
    if isinstance(synthesizer, InferredTrace):
        ways = follow(synthesizer.policy, task, robot, table)
        return WayTable.of([ways], table.table).batch([0], table.table.device)
    firsts = []
    for example in task.examples:
        robot.reset(example.scene)
        firsts.append(robot.observe())
    first, goal = table.rows(firsts), table.rows(example.goal for example in task.examples)
    return torch.stack([table.table[first], table.table[goal]], 1)[None]


def repair_all(
    repairer: Repairer,
    chains: Sequence[list[Attempt]],
    task: Task,
    table: FeatureTable,
    robot: MemoRobot,
    rounds: int = ROUNDS,
    go_on: Callable[[int], bool] = lambda done: True,
) -> None:
    """Repair each candidate on its own until it passes all pairs, nothing new comes, or the rounds are over.

    Args:
        repairer: in evaluation mode.
        chains: for each candidate its attempts so far; repairs are appended.
        task: the specification.
        table: embeddings of observations.
        robot: where repairs are run.
        rounds: how often a candidate is repaired at most.
        go_on: asked before each round, with how many are done; False ends it there.
    """
    open_chains = [chain for chain in chains if not chain[-1].solved]
    for done in range(rounds):
        if not open_chains or not go_on(done):
            return
        executions = table.executions([chain[-1] for chain in open_chains], task)
        tried: list[set[Program]] = [{a.program for a in chain} for chain in open_chains]
        with autocast():
            repaired = repairer.repair(executions, table.table, tried)
        new = [(chain, p) for chain, p in zip(open_chains, repaired, strict=True) if p is not None]
        for (chain, _), attempt in zip(new, attempt_all([p for _, p in new], task, robot), strict=True):
            chain.append(attempt)
        open_chains = [chain for chain, _ in new if not chain[-1].solved]


def synthesize_with(
    model: Model,
    task: Task,
    robot: MemoRobot,
    top_k: int = 20,
    rounds: int = ROUNDS,
    beam: int = BEAM,
    watch: Watch = NOBODY,
) -> Solution:
    """Propose, run, and, if the model has a repairer, repair: one candidate for each of the first ``top_k``.

    `Solution.candidates` are best first, each as far as its best attempt; `Candidate.rank` keeps
    the synthesizer's order. In `Solution.all_candidates` each has all its attempts.
    """
    meter = Meter(robot)
    table = FeatureTable(model.encoder, task.noise)
    proposals = propose(model, table, task, robot, max(beam, top_k))[:top_k]
    chains = [[attempt] for attempt in attempt_all([p.program for p in proposals], task, robot)]

    def go_on(done: int) -> bool:
        best = max((a for chain in chains for a in chain), key=lambda a: a.pairs_passed)
        solved = sum(chain[-1].solved for chain in chains)
        what = f"repair {done}" if done else "no repair yet"
        text = f"{len(chains)} candidates, {what}: {solved} pass all examples"
        watch.tell(News(text, best.passed, best.program, meter.actions, meter.seconds))
        return not watch.stopped()

    if model.repairer is not None and chains:
        repair_all(model.repairer, chains, task, table, robot, rounds, go_on)
    answers = best_first([_candidate(model, _until_best(chain), rank) for rank, chain in enumerate(chains)])
    last = tuple(_candidate(model, chain, rank) for rank, chain in enumerate(chains))
    return Solution(task.name, answers, meter.actions, meter.seconds, last)


def _until_best(chain: Sequence[Attempt]) -> Sequence[Attempt]:
    """Up to the first attempt that passes most pairs: what a repair made worse is not lost."""
    best = max(range(len(chain)), key=lambda i: (chain[i].pairs_passed, -i))
    return chain[: best + 1]


def _candidate(model: Model, chain: Sequence[Attempt], rank: int) -> Candidate:
    origin = model.synthesizer.name
    if len(chain) > 1 and model.repairer is not None:
        origin += f" + {model.repairer.name} x{len(chain) - 1}"
    return Candidate(tuple(chain), rank, origin)
