"""Baselines that learn nothing: programs drawn blindly from the prior.

One draws until a program passes all pairs, and looks at nothing but whether the last view equals the goal:
what was simulated once is free for it, too, and a program that fails in one scene is not run in the others.
The other draws as many programs as a synthesizer proposes.
"""

from __future__ import annotations

import numpy as np

from evaps.dsl import Program
from evaps.dsl.sampler import sample_program
from evaps.robots.memo import MemoRobot
from evaps.robots.noise import goal_match
from evaps.robots.together import run_together
from evaps.synthesis.budget import USUAL_BUDGET, Budget, Meter
from evaps.synthesis.solution import Candidate, Solution, attempt_all, best_first
from evaps.synthesis.watch import NOBODY, Watch
from evaps.tasks.task import Task

DRAWN_TOGETHER = 50  # programs


def synthesize_blindly(
    task: Task, robot: MemoRobot, budget: Budget = USUAL_BUDGET, seed: int = 0, watch: Watch = NOBODY
) -> Solution:
    """Draw programs until one passes all pairs or the budget is spent; else the one that got furthest.

    Args:
        task: the specification.
        robot: where programs run.
        budget: what it may cost.
        seed: of the programs; each task has its own, by its name.
        watch: may end it.
    """
    meter = Meter(robot)
    rng = _draws_of(task, seed)
    best: tuple[int, Program] | None = None
    over = False
    while not over and (best is None or best[0] < len(task.examples)):
        for passed, program in _furthest([sample_program(rng) for _ in range(DRAWN_TOGETHER)], task, robot):
            if best is None or passed > best[0]:
                best = passed, program
        over = meter.exceeds(budget) or watch.stopped()
    programs = [best[1]] if best else []
    candidates = tuple(Candidate((a,), 0, "blind") for a in attempt_all(programs, task, robot))
    return Solution(task.name, candidates, meter.actions, meter.seconds, candidates)


def synthesize_from_prior(task: Task, robot: MemoRobot, top_k: int = 20, seed: int = 0) -> Solution:
    """As many programs as are asked for, drawn from the prior: what a method without knowledge proposes.

    Args:
        task: the specification.
        robot: where programs run.
        top_k: how many distinct programs.
        seed: of the programs; each task has its own, by its name.
    """
    meter = Meter(robot)
    rng = _draws_of(task, seed)
    programs: dict[Program, None] = {}
    while len(programs) < top_k:
        programs[sample_program(rng)] = None
    attempts = attempt_all(list(programs), task, robot)
    drawn = tuple(Candidate((attempt,), rank, "prior") for rank, attempt in enumerate(attempts))
    return Solution(task.name, best_first(drawn), meter.actions, meter.seconds, drawn)


def _draws_of(task: Task, seed: int) -> np.random.Generator:
    return np.random.default_rng([seed, *task.name.encode()])


def _furthest(programs: list[Program], task: Task, robot: MemoRobot) -> list[tuple[int, Program]]:
    """For each program how many examples it passes in turn before it fails in one."""
    passed = dict.fromkeys(programs, 0)
    left = list(passed)
    for example in task.examples:
        traces = run_together(left, example.scene, robot)
        ends = zip(left, traces, strict=True)
        left = [p for p, t in ends if t.halted and goal_match(t.observations[-1], example.goal)]
        for program in left:
            passed[program] += 1
    return [(count, program) for program, count in passed.items()]
