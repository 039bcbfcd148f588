"""How many tasks are made in a second, and how far that is from what the engine could do."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Iterator
from pathlib import Path

from evaps.bench.timing import SEED, Figure, seconds_of
from evaps.dsl import run
from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.robots.doom import DoomRobot
from evaps.robots.memo import MemoRobot
from evaps.robots.workers import Workers, robot_map
from evaps.tasks.build import GENERATING, Build, make_part
from evaps.tasks.dataset import Part
from evaps.tasks.generate import Draft, generate_task

PART = 25  # tasks


def generation_figures(robot: DoomRobot, seconds: float) -> Iterator[Figure]:
    """Accepted tasks a second on all cores, frames included; and on one core, if nothing were rejected."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    rate = _rate(cores, 4 * seconds)
    memo = MemoRobot(robot, PERCEPTION_KEYS, eager=False)
    drafts = [generate_task(SEED, index, memo) for index in range(max(8, int(8 * seconds)))]
    floor = len(drafts) / seconds_of(lambda: _examples_alone(memo, drafts))
    memo.leave()
    yield Figure(f"tasks generated, {cores} workers", rate, "1/s", ">= 20" if cores == 2 else "")
    yield Figure("their six examples alone, one core", floor, "1/s")
    yield Figure("generation as a share of that floor", 100 * rate / (floor * cores), "%")


def _rate(workers: int, seconds: float) -> float:
    """From when every worker has done a part on, so that the start of the processes does not count."""
    parts = (Build(Part(Path("bench"), SEED, number, PART)) for number in itertools.count())
    results = robot_map(make_part, parts, Workers(workers), GENERATING)
    for _ in range(2 * workers):
        next(results)
    start, done = time.perf_counter(), 0
    for _ in results:
        done += PART
        if time.perf_counter() - start > seconds:
            break
    spent = time.perf_counter() - start
    del results  # ends the workers
    return done / spent


def _examples_alone(memo: MemoRobot, drafts: list[Draft]) -> None:
    for draft in drafts:
        memo.forget()
        for scene in draft.scenes:
            memo.reset(scene)
            memo.state()
            run(draft.program, memo)
            memo.state()
