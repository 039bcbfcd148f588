"""Memoised worlds against plain execution, on what synthesis really runs."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

from evaps.bench.tasks import specification
from evaps.bench.timing import Figure, best_of
from evaps.dsl import Program, run
from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.models import Model
from evaps.robots.base import Scene
from evaps.robots.doom import DoomRobot
from evaps.robots.memo import MemoRobot
from evaps.robots.together import run_together
from evaps.synthesis.repair import synthesize_with
from evaps.tasks.generate import Draft

CANDIDATES, REPAIRS = 20, 5


def memory_figures(robot: DoomRobot, model: Model, drafts: Sequence[Draft]) -> Iterator[Figure]:
    """Checking 20 candidates of the beam, and up to five repairs of each, on six scenes.

    Plain: each program on its own, from each scene. Memoised: what a round brings is run together. Several
    repairs often end in the same program; plain execution would save those by comparing texts alone, so that
    a second ratio leaves them out.
    """
    rounds = [_rounds(robot, model, draft) for draft in drafts]
    simulated = executed = distinct = 0
    distinct_time = 0.0

    def memoised() -> None:
        nonlocal simulated
        simulated = 0
        for draft, programs in zip(drafts, rounds, strict=True):
            memo = MemoRobot(robot, PERCEPTION_KEYS)
            for new in programs:
                for scene in draft.scenes:
                    run_together(new, scene, memo)
            simulated += memo.simulated_actions

    def plain() -> None:
        nonlocal executed, distinct, distinct_time
        executed = distinct = 0
        distinct_time = 0.0
        for draft, programs in zip(drafts, rounds, strict=True):
            seen: set[Program] = set()
            for program in (p for new in programs for p in new):
                start = time.perf_counter()
                actions = sum(_actions(robot, scene, program) for scene in draft.scenes)
                executed += actions
                if program not in seen:
                    distinct += actions
                    distinct_time += time.perf_counter() - start
                seen.add(program)

    with_memory, without = best_of(memoised, plain, rounds=1)
    count = sum(len(new) for programs in rounds for new in programs) / len(drafts)
    yield Figure("candidate checking: programs of a task, repairs included", count, "programs")
    yield Figure("candidate checking, plain / memoised: engine actions", executed / simulated, "x", ">= 5")
    yield Figure("candidate checking, plain / memoised: time", without / with_memory, "x", ">= 4")
    yield Figure("the same without equal programs: engine actions", distinct / simulated, "x")
    yield Figure("the same without equal programs: time", distinct_time / with_memory, "x")


def _actions(robot: DoomRobot, scene: Scene, program: Program) -> int:
    robot.reset(scene)
    return len(run(program, robot).actions)


def _rounds(robot: DoomRobot, model: Model, draft: Draft) -> list[list[Program]]:
    """The candidates, and what each round of repair made of those that were still wrong."""
    memo = MemoRobot(robot, PERCEPTION_KEYS)
    solution = synthesize_with(model, specification(draft), memo, CANDIDATES, REPAIRS)
    chains = [candidate.attempts for candidate in solution.all_candidates]
    memo.leave()
    return [[chain[i].program for chain in chains if len(chain) > i] for i in range(REPAIRS + 1)]
