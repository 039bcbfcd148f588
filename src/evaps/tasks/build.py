"""Making data sets: in parts, on several workers or machines, resumable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from evaps.dsl.sampler import SamplerConfig
from evaps.files import write_atomically
from evaps.robots.frames import digest
from evaps.robots.memo import MemoRobot
from evaps.robots.workers import Workers
from evaps.tasks.dataset import (
    FRAME_SCHEMA,
    TASK_SCHEMA,
    Part,
    frame_row,
    rows_bytes,
    split_of,
    table_bytes,
)
from evaps.tasks.files import read_table
from evaps.tasks.generate import SCENES, Draft, generate_task
from evaps.tasks.manifest import PART, DatasetError, write_identity
from evaps.tasks.parts import ROBOT as USUAL_ROBOT
from evaps.tasks.parts import Files, make_parts
from evaps.tasks.render import render_parts

Shard = tuple[int, int]
"""Which share of a data set, from 1, and of how many."""

# A program asks for few of the places that it comes to, and an engine stands in each scene while it is chosen
# what its conditions ask.
GENERATING = replace(USUAL_ROBOT, eager=False, spares=SCENES - 1)


@dataclass(frozen=True)
class Build:
    """Some indices of a data set, to be made together.

    Attributes:
        part: where to, and which indices.
        frames: whether the observations are kept too.
        config: how random programs look.
    """

    part: Part
    frames: bool = True
    config: SamplerConfig = field(default_factory=SamplerConfig)

    @property
    def path(self) -> Path:
        """The file of the tasks."""
        return self.part.path


def make_part(robot: MemoRobot, build: Build) -> Files:
    """Generate the tasks of a part; its frames come first, so that the tasks mean: done."""
    part = build.part
    drafts = {i: generate_task(part.seed, i, robot, build.config) for i in part.indices}
    files = {}
    if build.frames:
        rows = [frame_row(i, draft.first, draft.last) for i, draft in drafts.items()]
        files[part.frames] = rows_bytes(rows, FRAME_SCHEMA)
    files[part.path] = rows_bytes([_task_row(i, draft) for i, draft in drafts.items()], TASK_SCHEMA)
    return files


def _task_row(index: int, draft: Draft) -> dict[str, Any]:
    return {
        "index": index,
        "program": str(draft.program),
        "split": split_of(draft.program),
        "steps": draft.steps,
        "scenes": [scene.to_json() for scene in draft.scenes],
        "states": [state.to_json() for state in draft.states],
        "actions": [" ".join(actions) for actions in draft.actions],
        "first_digests": [digest(frame) for frame in draft.first],
        "last_digests": [digest(frame) for frame in draft.last],
    }


def generate(
    folder: Path,
    tasks: int,
    seed: int,
    workers: Workers,
    part: int = PART,
    shard: Shard = (1, 1),
    frames: bool = True,
) -> int:
    """Make a data set of so many tasks with distinct programs, or go on where it was interrupted.

    Tasks come in the order of their indices; of equal programs the first is kept. A shard makes its share of
    the parts and no more: put the ``parts`` and ``frames`` of all shards into one folder and call this again
    without a shard; it makes the few that are missing, and joins them.

    Args:
        folder: where to.
        tasks: how many, in all shards together.
        seed: of everything random.
        workers: who makes them.
        part: how many indices are made together, and lost together where the job is stopped.
        shard: which share to make, from 1, and of how many.
        frames: whether to keep the observations; without them, `render` makes them later.

    Returns:
        how many indices it took.

    Raises:
        DatasetError: the folder holds another data set, or other files.
    """
    write_identity(folder, tasks, seed, part)
    share, shards = shard
    wanted = -(-tasks // shards)
    made: list[Part] = []
    while (missing := wanted - _distinct(made)) > 0:
        for _ in range(-(-missing // part)):
            made.append(Part(folder, seed, share - 1 + shards * len(made), part))
        builds = [Build(p, frames) for p in made]
        make_parts(make_part, builds, workers, "tasks", part, robot=GENERATING)
    if frames:  # of parts that were made without
        render_parts(made, workers)
    if shards == 1:
        _write_index(folder, made, tasks)
    return len(made) * part


def _distinct(parts: Sequence[Part]) -> int:
    if not parts:
        return 0
    tables = [read_table(part.path, DatasetError, columns=["program"]) for part in parts]
    return int(pc.count_distinct(pa.concat_tables(tables)["program"]).as_py())


def _write_index(folder: Path, parts: Sequence[Part], tasks: int) -> None:
    """Join the parts into one file of distinct programs; parts that are not needed are removed."""
    table = pa.concat_tables([read_table(part.path, DatasetError) for part in parts])
    first: dict[str, int] = {}
    for position, program in enumerate(table["program"].to_pylist()):
        first.setdefault(program, position)
    needed = {path for part in parts for path in (part.path, part.frames, part.traces)}
    for room in ("parts", "frames", "traces"):
        for path in folder.glob(f"{room}/*.parquet"):
            if path not in needed:  # shards may have made a few more than one run needs
                path.unlink()
    index = table.take(list(first.values())[:tasks]).combine_chunks()
    write_atomically(folder / "tasks.parquet", table_bytes(index))
