"""The symbolic baseline: programs drawn blindly from the prior, run until one passes all pairs.

It learns nothing and looks at nothing but whether the last view equals the goal. What was simulated once is
free for it, too, and a program that fails in one scene is not run in the others.
"""

from __future__ import annotations

import numpy as np

from evaps.dsl import Program
from evaps.dsl.sampler import sample_program
from evaps.robots.frames import digest
from evaps.robots.memo import MemoRobot
from evaps.robots.together import run_together
from evaps.synthesis.budget import USUAL_BUDGET, Budget, Meter
from evaps.synthesis.solution import Candidate, Solution, attempt_all
from evaps.tasks.task import Task

DRAWN_TOGETHER = 50  # programs


def synthesize_blindly(
    task: Task, robot: MemoRobot, budget: Budget = USUAL_BUDGET, seed: int = 0
) -> Solution:
    """Draw programs until one passes all pairs or the budget is spent; else the one that got furthest.

    Args:
        task: the specification.
        robot: where programs run.
        budget: what it may cost.
        seed: of the programs.
    """
    meter = Meter(robot)
    rng = np.random.default_rng(seed)
    best: tuple[int, Program] | None = None
    over = False
    while not over and (best is None or best[0] < len(task.examples)):
        for passed, program in _furthest([sample_program(rng) for _ in range(DRAWN_TOGETHER)], task, robot):
            if best is None or passed > best[0]:
                best = passed, program
        over = meter.exceeds(budget)
    programs = [best[1]] if best else []
    candidates = tuple(Candidate((a,), 0, "blind") for a in attempt_all(programs, task, robot))
    return Solution(task.name, candidates, meter.actions, meter.seconds, candidates)


def _furthest(programs: list[Program], task: Task, robot: MemoRobot) -> list[tuple[int, Program]]:
    """For each program how many examples it passes in turn before it fails in one."""
    passed = dict.fromkeys(programs, 0)
    left = list(passed)
    for example in task.examples:
        goal = digest(example.goal)
        traces = run_together(left, example.scene, robot)
        ends = zip(left, traces, strict=True)
        left = [p for p, t in ends if t.halted and digest(t.observations[-1]) == goal]
        for program in left:
            passed[program] += 1
    return [(count, program) for program, count in passed.items()]
