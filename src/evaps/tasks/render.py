"""The frames of a data set, made again from its programs and scenes: the ends of its runs, or all of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from evaps.dsl import Program, Trace, run
from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.robots.base import Scene
from evaps.robots.memo import MemoRobot, RememberedView
from evaps.robots.workers import Workers
from evaps.tasks.build import frame_row, write_identity
from evaps.tasks.dataset import (
    FRAME_SCHEMA,
    PART,
    TRACE_SCHEMA,
    DatasetError,
    Part,
    read_identity,
    rows_bytes,
)
from evaps.tasks.frames import pack_frames
from evaps.tasks.parts import ROBOT, Files, make_parts


@dataclass(frozen=True)
class Rendering:
    """A part of a data set whose frames are to be made again.

    Attributes:
        part: which.
        traces: all observations of the runs, not only the first and the last.
        rows: of its tasks; empty until they are loaded.
    """

    part: Part
    traces: bool
    rows: tuple[dict[str, Any], ...] = ()

    @property
    def path(self) -> Path:
        """The file of the frames."""
        return self.part.traces if self.traces else self.part.frames

    def loaded(self) -> Rendering:
        """The same with the rows of its tasks."""
        return replace(self, rows=tuple(pq.read_table(self.part.path).to_pylist()))


def render_part(robot: MemoRobot, rendering: Rendering) -> Files:
    """Run the programs of a part again.

    Raises:
        DatasetError: a program no longer does or shows what the data set says.
    """
    row, schema = (_trace_row, TRACE_SCHEMA) if rendering.traces else (_end_row, FRAME_SCHEMA)
    return {rendering.path: rows_bytes([row(task, robot) for task in rendering.rows], schema)}


def run_again(task: dict[str, Any], robot: MemoRobot) -> Iterator[Trace[RememberedView]]:
    """The runs of a task's program on its scenes.

    Raises:
        DatasetError: the program no longer does or shows what the data set says.
    """
    robot.forget()
    program = Program.parse(task["program"])
    known = zip(task["scenes"], task["actions"], task["first_digests"], task["last_digests"], strict=True)
    for scene, actions, first, last in known:
        robot.reset(Scene.from_json(scene))
        begin = robot.observe().digest
        trace = run(program, robot)
        end = robot.observe().digest
        if (" ".join(trace.actions), begin, end) != (actions, first, last) or not trace.halted:
            raise DatasetError(f"task {task['index']} does not run as it did; generate the data set again")
        yield trace


def _end_row(task: dict[str, Any], robot: MemoRobot) -> dict[str, Any]:
    ends = [[t.observations[i].frame for i in (0, -1)] for t in run_again(task, robot)]
    return frame_row(task["index"], *zip(*ends, strict=True))


def _trace_row(task: dict[str, Any], robot: MemoRobot) -> dict[str, Any]:
    row: dict[str, Any] = {"index": task["index"], "observations": [], "perceptions": []}
    for trace in run_again(task, robot):
        row["observations"].append(pack_frames([view.frame for view in trace.observations]))
        seen = [view.perceptions for view in trace.observations]
        row["perceptions"].append([[p for p in PERCEPTION_KEYS if p in true] for true in seen])
    return row


def render(folder: Path, workers: Workers, traces: bool = False) -> int:
    """Make the frames that were left out, or go on with it; the same bytes as if they had been kept.

    Args:
        folder: of a data set.
        workers: who makes them.
        traces: all observations of the runs, which some methods learn from, into ``traces``; otherwise the
            first and the last ones, into ``frames``.

    Returns:
        how many tasks have them now.

    Raises:
        DatasetError: the folder holds no data set, or one of another robot or engine.
    """
    identity = read_identity(folder)
    size = identity.get("part", PART)
    write_identity(folder, identity["tasks"], identity["seed"], size)
    numbers = sorted(int(path.stem.rpartition("-")[2]) for path in folder.glob("parts/tasks-*.parquet"))
    parts = [Rendering(Part(folder, 0, number, size), traces) for number in numbers]  # a shard's have gaps
    robot = replace(ROBOT, eager=traces)  # in the middle of a run nobody looks, unless its trace is wanted
    make_parts(render_part, parts, workers, "tasks", size, Rendering.loaded, robot)
    return len(parts) * size
