"""Whether programs do on a data set's scenes what the right ones do: for validation, and for rewards."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Int

from evaps.dsl import Program
from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.robots.base import Scene, WorldState, state_match
from evaps.robots.memo import MemoRobot
from evaps.robots.together import run_together
from evaps.robots.world import world
from evaps.tasks.dataset import Dataset
from evaps.tasks.task import EXAMPLES

FRAME_BUDGET = 32 << 20  # bytes; only ends are looked at, and no frame a second time


class Judge:
    """Runs programs on tasks of a data set, on a robot of its own, and remembers how far each came.

    Args:
        dataset: whose tasks.
    """

    def __init__(self, dataset: Dataset) -> None:
        self._dataset = dataset
        self._robot = MemoRobot(world().robot(), PERCEPTION_KEYS, eager=False, budget=FRAME_BUDGET)
        self._passed: dict[tuple[int, Program], int] = {}

    def passed(self, position: int, programs: Sequence[Program]) -> Int[np.ndarray, " program"]:
        """In how many of the six scenes, in order, each program ends in the right state until it fails.

        Who fails in one is not run in the next: most fail in the first.

        Args:
            position: of the task.
            programs: run together.
        """
        new = [p for p in dict.fromkeys(programs) if (position, p) not in self._passed]
        if new:
            passed = self._run(position, new)
            self._passed |= {(position, program): count for program, count in passed.items()}
        return np.array([self._passed[position, p] for p in programs], np.int64)

    def _run(self, position: int, programs: Sequence[Program]) -> dict[Program, int]:
        row = self._dataset.rows[position]
        self._robot.forget()
        passed = dict.fromkeys(programs, 0)
        left = list(programs)
        for scene, state in zip(row["scenes"], row["states"], strict=True):
            ends = self._ends(left, Scene.from_json(scene), WorldState.from_json(state))
            left = [program for program, right in zip(left, ends, strict=True) if right]
            for program in left:
                passed[program] += 1
        return passed

    def generalize(self, position: int, programs: Sequence[Program]) -> Bool[np.ndarray, " program"]:
        """Which programs end in all six scenes in the right states."""
        return self.passed(position, programs) > EXAMPLES

    def solve(self, position: int, programs: Sequence[Program]) -> Bool[np.ndarray, " program"]:
        """Which programs end in the five specification scenes in the right states."""
        return self.passed(position, programs) >= EXAMPLES

    def share_right(self, positions: Sequence[int], programs: Sequence[Program | None]) -> float:
        """The share of tasks that a program solves; without a program none is."""
        pairs = zip(positions, programs, strict=True)
        return float(np.mean([p is not None and self.solve(position, [p])[0] for position, p in pairs]))

    def _ends(self, programs: Sequence[Program], scene: Scene, state: WorldState) -> list[bool]:
        traces = run_together(programs, scene, self._robot)
        right = []
        for trace in traces:
            self._robot.reset(scene)
            for action in trace.actions:
                self._robot.act(action)
            right.append(trace.halted and state_match(self._robot.state(), state))
        return right
