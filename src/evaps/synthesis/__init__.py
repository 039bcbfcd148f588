"""From a task to a program: propose, run, repair."""

from __future__ import annotations

from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.models import Model
from evaps.robots.doom import DoomRobot
from evaps.robots.memo import MemoRobot
from evaps.synthesis.repair import synthesize_with
from evaps.synthesis.solution import Attempt, Candidate, Solution
from evaps.tasks.task import Task

__all__ = ["Attempt", "Candidate", "Solution", "synthesize", "synthesize_with"]


def synthesize(task: Task, model: Model, top_k: int = 20, rounds: int = 5) -> Solution:
    """Write a program for a task, on a Doom robot of its own.

    Args:
        task: five scenes and what the robot should see at the end.
        model: from :func:`evaps.load_model`.
        top_k: how many of the synthesizer's candidates are run and repaired.
        rounds: how often each is repaired at most.
    """
    robot = MemoRobot(DoomRobot(), PERCEPTION_KEYS)
    try:
        return synthesize_with(model, task, robot, top_k, rounds)
    finally:
        robot.close()
