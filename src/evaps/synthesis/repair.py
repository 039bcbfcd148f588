"""The paper's loop: run each candidate, repair it with what the robot saw, and run it again."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import torch

from evaps.dsl import Program
from evaps.models import Model
from evaps.models.base import Repairer
from evaps.models.beam import Proposal, beam_search
from evaps.models.compute import autocast
from evaps.robots.memo import MemoRobot
from evaps.synthesis.features import FeatureTable
from evaps.synthesis.solution import Attempt, Candidate, Solution, attempt, best_first
from evaps.tasks.task import Task

ROUNDS = 5
BEAM = 32  # Bunel et al. decode with 64; on two cores half of it must do


def propose(
    model: Model, table: FeatureTable, task: Task, robot: MemoRobot, beam: int = BEAM
) -> list[Proposal]:
    """The synthesizer's programs for a task, most probable first."""
    firsts = []
    for example in task.examples:
        robot.reset(example.scene)
        firsts.append(robot.observe())
    first, goal = table.rows(firsts), table.rows(example.goal for example in task.examples)
    features = torch.stack([table.table[first], table.table[goal]], 1)[None]
    with autocast():
        return beam_search(model.synthesizer, features, beam)[0]


def repair_all(
    repairer: Repairer,
    chains: Sequence[list[Attempt]],
    task: Task,
    table: FeatureTable,
    robot: MemoRobot,
    rounds: int = ROUNDS,
) -> None:
    """Repair each candidate on its own until it passes all pairs, nothing new comes, or the rounds are over.

    Args:
        repairer: in evaluation mode.
        chains: for each candidate its attempts so far; repairs are appended.
        task: the specification.
        table: embeddings of observations.
        robot: where repairs are run.
        rounds: how often a candidate is repaired at most.
    """
    open_chains = [chain for chain in chains if not chain[-1].solved]
    for _ in range(rounds):
        if not open_chains:
            return
        executions = table.executions([chain[-1] for chain in open_chains], task)
        tried: list[set[Program]] = [{a.program for a in chain} for chain in open_chains]
        with autocast():
            repaired = repairer.repair(executions, table.table, tried)
        going_on = []
        for chain, program in zip(open_chains, repaired, strict=True):
            if program is not None:
                chain.append(attempt(program, task, robot))
                if not chain[-1].solved:
                    going_on.append(chain)
        open_chains = going_on


@dataclass
class Meter:
    """Counts what a synthesis costs: seconds and simulated actions, from where it was made."""

    robot: MemoRobot

    def __post_init__(self) -> None:
        self.start, self.before = time.perf_counter(), self.robot.simulated_actions

    def solution(self, task: Task, chains: Sequence[list[Attempt]], names: Sequence[str]) -> Solution:
        """What these chains of attempts come to.

        Args:
            task: what they are for.
            chains: in the synthesizer's order.
            names: the synthesizer's, and the repairer's if there is one.
        """
        candidates = [
            Candidate(tuple(chain), rank, _origin(names, chain)) for rank, chain in enumerate(chains)
        ]
        actions = self.robot.simulated_actions - self.before
        seconds = time.perf_counter() - self.start
        return Solution(task.name, best_first(candidates), actions, seconds, tuple(candidates))


def _origin(names: Sequence[str], chain: Sequence[Attempt]) -> str:
    return names[0] if len(chain) == 1 else f"{names[0]} + {names[1]} x{len(chain) - 1}"


def run_proposals(
    model: Model, task: Task, robot: MemoRobot, table: FeatureTable, top_k: int = 20, beam: int = BEAM
) -> list[list[Attempt]]:
    """The synthesizer's first ``top_k`` programs, each run: chains that a repairer can go on with."""
    proposals = propose(model, table, task, robot, max(beam, top_k))[:top_k]
    return [[attempt(p.program, task, robot)] for p in proposals]


def synthesize_with(
    model: Model, task: Task, robot: MemoRobot, top_k: int = 20, rounds: int = ROUNDS, beam: int = BEAM
) -> Solution:
    """Propose, run, and, if the model has a repairer, repair: one candidate for each of the first ``top_k``.

    The order of :attr:`Solution.candidates` is best first; :attr:`Candidate.rank` keeps the synthesizer's.
    """
    meter, table = Meter(robot), FeatureTable(model.encoder)
    chains = run_proposals(model, task, robot, table, top_k, beam)
    names = [model.synthesizer.name]
    if model.repairer is not None:
        repair_all(model.repairer, chains, task, table, robot, rounds)
        names.append(model.repairer.name)
    return meter.solution(task, chains, names)
