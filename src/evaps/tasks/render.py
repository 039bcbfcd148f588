"""The frames of a data set, made again from its programs and scenes: the ends of its runs, or all of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pyarrow as pa

from evaps.dsl import Program, Trace, run
from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.robots.base import Scene
from evaps.robots.memo import MemoRobot, RememberedView
from evaps.robots.workers import Workers
from evaps.tasks.dataset import FRAME_SCHEMA, TRACE_SCHEMA, Part, frame_row, rows_bytes
from evaps.tasks.files import read_table
from evaps.tasks.frames import pack_frames
from evaps.tasks.manifest import PART, DatasetError, read_identity, write_identity
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

    def is_complete(self) -> bool:
        """Whether the file holds all of the part's tasks: it may be damaged, or of a smaller data set."""
        try:
            there = read_table(self.path, DatasetError, columns=["index"])["index"].to_pylist()
        except DatasetError:
            return False
        return set(self._wanted(["index"])["index"].to_pylist()) <= set(there)

    def loaded(self) -> Rendering:
        """The same with the rows of its tasks; without their part, those that the data set has kept.

        Raises:
            DatasetError: their file is damaged.
        """
        return replace(self, rows=tuple(self._wanted().to_pylist()))

    def _wanted(self, columns: list[str] | None = None) -> pa.Table:
        if self.part.path.exists():
            return read_table(self.part.path, DatasetError, columns=columns)
        indices = self.part.indices
        kept = [("index", ">=", indices.start), ("index", "<", indices.stop)]
        path = self.part.folder / "tasks.parquet"
        return read_table(path, DatasetError, columns=columns, filters=kept)


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
    tasks, size = identity.get("tasks", 0), identity.get("part", PART)
    write_identity(folder, tasks, identity.get("seed", 0), size)
    numbers = {int(path.stem.rpartition("-")[2]) for path in folder.glob("parts/tasks-*.parquet")}
    if (kept := folder / "tasks.parquet").exists():
        indices = read_table(kept, DatasetError, columns=["index"])["index"].to_pylist()
        numbers |= {index // size for index in indices}
    if not numbers:
        raise DatasetError(f"{folder} has no tasks yet; make them with: evaps generate {folder}")
    parts = [Part(folder, 0, number, size) for number in sorted(numbers)]  # a shard's have gaps
    render_parts(parts, workers, traces)
    return min(len(parts) * size, tasks)


def render_parts(parts: Sequence[Part], workers: Workers, traces: bool = False) -> None:
    """Make the frames, or the traces, of those parts that have none."""
    robot = replace(ROBOT, eager=traces)  # in the middle of a run nobody looks, unless its trace is wanted
    renderings = [Rendering(part, traces) for part in parts]
    for rendering in renderings:
        if rendering.path.exists() and not rendering.is_complete():
            rendering.path.unlink()
    make_parts(render_part, renderings, workers, "tasks", parts[0].size, Rendering.loaded, robot)
