"""Random tasks to measure with."""

from __future__ import annotations

from evaps.bench.timing import SEED
from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.robots.doom import DoomRobot
from evaps.robots.memo import MemoRobot
from evaps.tasks.generate import Draft, generate_task
from evaps.tasks.task import EXAMPLES, Example, Task


def random_tasks(robot: DoomRobot, count: int) -> list[Draft]:
    """Tasks of a seed of their own."""
    memo = MemoRobot(robot, PERCEPTION_KEYS, eager=False)
    drafts = [generate_task(SEED + 2, index, memo) for index in range(count)]
    memo.leave()
    return drafts


def specification(draft: Draft) -> Task:
    """What a method sees of a task."""
    return Task("bench", tuple(map(Example, draft.scenes[:EXAMPLES], draft.last)))
