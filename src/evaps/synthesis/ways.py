"""Ways: what a robot saw and did on a task's scenes, as a policy goes them or as the gold program does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from evaps.dsl import Program, run
from evaps.dsl.interpreter import Limits
from evaps.dsl.sampler import ACTIONS, PERCEPTION_KEYS
from evaps.models.inferred_trace import START, STOP, Policy, Ways
from evaps.robots.base import Scene
from evaps.robots.frames import Observation
from evaps.robots.memo import MemoRobot, RememberedView
from evaps.robots.noise import goal_match
from evaps.synthesis.features import FeatureTable
from evaps.tasks.task import Task

LONGEST = Limits().actions
"""Actions of the longest way: a program may do no more either."""


class Way(NamedTuple):
    """A way on one scene, as rows of a table of embeddings.

    Attributes:
        rows: what was seen at each time.
        perceived: which perceptions were true then, a bit for each of PERCEPTION_KEYS.
        actions: what was done then, STOP at last.
        goal: the row of the goal.
        reached: whether the last view equals the goal.
    """

    rows: list[int]
    perceived: list[int]
    actions: list[int]
    goal: int
    reached: bool


def gold_ways(program: Program, task: Task, robot: MemoRobot, table: FeatureTable) -> list[Way]:
    """The ways that a program takes on the scenes of a task; for training alone."""
    ways = []
    for example in task.examples:
        robot.reset(example.scene)
        trace = run(program, robot)
        actions = [*map(ACTIONS.index, trace.actions), STOP]
        views = trace.observations
        (goal,) = table.rows([example.goal])
        ways.append(Way(table.rows(views), [_bits(v) for v in views], actions, goal, trace.halted))
    return ways


@torch.inference_mode()
def follow(policy: Policy, task: Task, robot: MemoRobot, table: FeatureTable) -> list[Way]:
    """The ways that a policy takes on the scenes of a task: each predicted action is executed."""
    goals = table.rows(example.goal for example in task.examples)
    views = []
    for example in task.examples:
        robot.reset(example.scene)
        views.append(robot.observe())
    ways = [Way([], [], [], goal, False) for goal in goals]
    done: list[list[str]] = [[] for _ in ways]
    last, hidden = torch.full((len(ways),), START, device=table.table.device), policy.start(len(ways))
    for time in range(LONGEST + 1):
        _look(ways, views, table)
        seen = table.table[[way.rows[-1] for way in ways]]
        perceived = _unpacked([way.perceived[-1] for way in ways]).to(seen.device)
        logits, hidden = policy.step(seen, perceived, table.table[goals], last, hidden)
        last = logits.argmax(-1) if time < LONGEST else torch.full_like(last, STOP)
        for i, (way, action) in enumerate(zip(ways, last.tolist(), strict=True)):
            if not way.actions or way.actions[-1] != STOP:
                way.actions.append(action)
                if action != STOP:
                    done[i].append(ACTIONS[action])
                    views[i] = _view_after(task.examples[i].scene, done[i], robot)
        if all(way.actions[-1] == STOP for way in ways):
            break
    return [_ended(way, view, e.goal) for way, view, e in zip(ways, views, task.examples, strict=True)]


def _look(ways: Sequence[Way], views: Sequence[RememberedView], table: FeatureTable) -> None:
    """What is seen now; where a way is over, its last view again, which `_ended` cuts off."""
    for way, row, view in zip(ways, table.rows(views), views, strict=True):
        way.rows.append(row)
        way.perceived.append(_bits(view))


def _view_after(scene: Scene, actions: Sequence[str], robot: MemoRobot) -> RememberedView:
    robot.reset(scene)
    for action in actions:
        robot.act(action)
    return robot.observe()


def _ended(way: Way, view: RememberedView, goal: Observation) -> Way:
    time = len(way.actions)
    reached = goal_match(view, goal)
    return Way(way.rows[:time], way.perceived[:time], way.actions, way.goal, reached)


def _bits(view: object) -> int:
    true: frozenset[str] = getattr(view, "perceptions", frozenset())
    return sum(1 << i for i, key in enumerate(PERCEPTION_KEYS) if key in true)


def _unpacked(bits: Sequence[int] | Int[np.ndarray, ...]) -> Float[Tensor, "... perception"]:
    shifts = np.arange(len(PERCEPTION_KEYS))
    return torch.from_numpy((np.asarray(bits)[..., None] >> shifts & 1).astype(np.float32))


@dataclass(frozen=True)
class WayTable:
    """Ways of many tasks in arrays that batches are cut from; rows count through a table of embeddings.

    Attributes:
        rows: what was seen at each time; -1 behind the end.
        perceived: bits of what was perceived.
        actions: what was done; STOP behind the end, too.
        goal: rows of the goals.
        reached: which ways ended at their goals.
        table: embeddings, float16 or float32.
    """

    rows: Int[np.ndarray, "task pair time"]
    perceived: Int[np.ndarray, "task pair time"]
    actions: Int[np.ndarray, "task pair time"]
    goal: Int[np.ndarray, "task pair"]
    reached: Bool[np.ndarray, "task pair"]
    table: Tensor

    @classmethod
    def of(cls, tasks: Sequence[Sequence[Way]], table: Tensor) -> WayTable:
        """Pad ways to the longest."""
        shape = (len(tasks), len(tasks[0]), max(len(way.rows) for ways in tasks for way in ways))
        rows, perceived, actions = np.full(shape, -1), np.zeros(shape, int), np.full(shape, STOP)
        for i, ways in enumerate(tasks):
            for j, way in enumerate(ways):
                time = slice(len(way.rows))
                rows[i, j, time], perceived[i, j, time] = way.rows, way.perceived
                actions[i, j, time] = way.actions
        goal = np.array([[way.goal for way in ways] for ways in tasks])
        reached = np.array([[way.reached for way in ways] for ways in tasks])
        return cls(rows, perceived, actions, goal, reached, table)

    def batch(self, tasks: Sequence[int], device: torch.device) -> Ways:
        """The ways of some tasks, those that missed their goals without a real time, on a device."""
        chosen = np.asarray(tasks)
        rows = self.rows[chosen]
        longest = (rows >= 0).sum(-1).max()
        rows = rows[..., :longest]
        real = (rows >= 0) & self.reached[chosen][..., None]
        seen = self.table[torch.from_numpy(rows.clip(min=0)).to(self.table.device)]
        goal = self.table[torch.from_numpy(self.goal[chosen]).to(self.table.device)]
        return Ways(
            seen.float().to(device),
            _unpacked(self.perceived[chosen][..., :longest]).to(device),
            torch.from_numpy(self.actions[chosen][..., :longest]).to(device),
            torch.from_numpy(real).to(device),
            goal.float().to(device),
        )
