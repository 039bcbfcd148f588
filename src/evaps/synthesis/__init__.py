"""From a task to a program: propose, run, repair."""

from __future__ import annotations

from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.models import Model
from evaps.robots.doom import DoomRobot
from evaps.robots.memo import MemoRobot
from evaps.synthesis.best_first import synthesize_best_first
from evaps.synthesis.blind import synthesize_blindly
from evaps.synthesis.budget import USUAL_BUDGET, Budget
from evaps.synthesis.enumeration import synthesize_by_enumeration
from evaps.synthesis.repair import ROUNDS, synthesize_with
from evaps.synthesis.solution import Attempt, Candidate, Solution
from evaps.synthesis.verified import ALL_PARTS, Parts, synthesize_verified
from evaps.tasks.task import EXAMPLES, Task

__all__ = ["Attempt", "Budget", "Candidate", "Solution", "solve", "synthesize", "synthesize_with"]

PARTS = {
    "verified": ALL_PARTS,
    "verified-no-guide": Parts(guide=False),
    "verified-no-sharing": Parts(sharing=False),
    "verified-no-beam": Parts(beam=False),
}
SPARES = EXAMPLES - 1
"""Engines beside the first one with which synthesis is quickest: one for each scene."""


def synthesize(
    task: Task, model: Model, top_k: int = 20, rounds: int = ROUNDS, budget: Budget = USUAL_BUDGET
) -> Solution:
    """Write a program for a task, on Doom robots of its own.

    Args:
        task: five scenes and what the robot should see at the end.
        model: from :func:`evaps.load_model`; its method decides how it is done.
        top_k: how many candidates come back at most; in the paper's loop they are the synthesizer's first
            ones, each run and repaired.
        rounds: how often each is repaired at most.
        budget: what a verified search may cost.
    """
    robot = MemoRobot(DoomRobot(), PERCEPTION_KEYS, spares=[DoomRobot() for _ in range(SPARES)])
    try:
        return solve(model, task, robot, top_k, rounds, budget)
    finally:
        robot.close()


def solve(
    model: Model,
    task: Task,
    robot: MemoRobot,
    top_k: int = 20,
    rounds: int = ROUNDS,
    budget: Budget = USUAL_BUDGET,
) -> Solution:
    """The same on a robot that is there."""
    if model.search is None:
        return synthesize_with(model, task, robot, top_k, rounds)
    if model.search == "sed-search":
        return synthesize_best_first(model, task, robot, top_k)
    if model.search == "enumeration":
        return synthesize_by_enumeration(task, robot, budget)
    if model.search == "blind":
        return synthesize_blindly(task, robot, budget)
    return synthesize_verified(model, task, robot, top_k, budget, PARTS[model.search])
