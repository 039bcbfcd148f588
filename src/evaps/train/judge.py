"""Whether programs do on a data set's scenes what the right ones do: for validation, and for rewards."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

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
    """Runs programs on tasks of a data set, on a robot of its own, and remembers the verdicts.

    Args:
        dataset: whose tasks.
    """

    def __init__(self, dataset: Dataset) -> None:
        self._dataset = dataset
        self._robot = MemoRobot(world().robot(), PERCEPTION_KEYS, eager=False, budget=FRAME_BUDGET)
        self._verdicts: dict[tuple[int, Program], np.ndarray[tuple[int], np.dtype[np.bool_]]] = {}

    def semantic(self, position: int, program: Program) -> bool:
        """Whether it ends on the five specification scenes in the same states."""
        return bool(self.matches(position, [program])[0, :EXAMPLES].all())

    def share_right(self, positions: Sequence[int], programs: Sequence[Program | None]) -> float:
        """The share of tasks on which a program matches semantically; without a program none does."""
        pairs = zip(positions, programs, strict=True)
        return float(np.mean([p is not None and self.semantic(position, p) for position, p in pairs]))

    def matches(
        self, position: int, programs: Sequence[Program]
    ) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
        """For each program and each of the task's six scenes, whether it ends in the right state.

        Args:
            position: of the task.
            programs: run together.
        """
        new = [p for p in dict.fromkeys(programs) if (position, p) not in self._verdicts]
        if new:
            row = self._dataset.rows[position]
            self._robot.forget()
            columns = [
                self._ends(new, Scene.from_json(scene), WorldState.from_json(state))
                for scene, state in zip(row["scenes"], row["states"], strict=True)
            ]
            for program, verdict in zip(new, np.array(columns).T, strict=True):
                self._verdicts[position, program] = verdict
        return np.stack([self._verdicts[position, p] for p in programs])

    def solving(self, position: int, programs: Sequence[Program]) -> list[Program]:
        """Those that end right in all six scenes; who fails in one is not run in the next."""
        row = self._dataset.rows[position]
        self._robot.forget()
        left = list(programs)
        for scene, state in zip(row["scenes"], row["states"], strict=True):
            ends = self._ends(left, Scene.from_json(scene), WorldState.from_json(state))
            left = [program for program, right in zip(left, ends, strict=True) if right]
        return left

    def _ends(self, programs: Sequence[Program], scene: Scene, state: WorldState) -> list[bool]:
        traces = run_together(programs, scene, self._robot)
        right = []
        for trace in traces:
            self._robot.reset(scene)
            for action in trace.actions:
                self._robot.act(action)
            right.append(trace.halted and state_match(self._robot.state(), state))
        return right
