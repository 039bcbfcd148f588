"""Making data sets: in parts, on several workers or machines, resumable; frames may be left out at first."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from evaps.dsl import Program, run
from evaps.dsl.sampler import SamplerConfig
from evaps.files import write_atomically
from evaps.robots.base import Observation, Scene
from evaps.robots.doom import ROBOT
from evaps.robots.memo import MemoRobot
from evaps.tasks.dataset import (
    FORMAT,
    FRAME_SCHEMA,
    PART,
    TASK_SCHEMA,
    DatasetError,
    Part,
    read_identity,
    split_of,
    write_table,
)
from evaps.tasks.frames import pack_frame
from evaps.tasks.generate import Draft, generate_task
from evaps.tasks.parts import make_parts

Shard = tuple[int, int]
"""Which share of a data set, from 1, and of how many."""


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


def make_part(robot: MemoRobot, build: Build) -> None:
    """Generate the tasks of a part and write them; frames first, so that the tasks mean: done."""
    part = build.part
    drafts = {i: generate_task(part.seed, i, robot, build.config) for i in part.indices}
    if build.frames:
        write_table(part.frames, [_frames(i, d.first, d.last) for i, d in drafts.items()], FRAME_SCHEMA)
    write_table(part.path, [_task(i, draft) for i, draft in drafts.items()], TASK_SCHEMA)


def _task(index: int, draft: Draft) -> dict[str, Any]:
    return {
        "index": index,
        "program": str(draft.program),
        "split": split_of(draft.program),
        "steps": draft.steps,
        "scenes": [scene.to_json() for scene in draft.scenes],
        "states": [state.to_json() for state in draft.states],
        "actions": [" ".join(actions) for actions in draft.actions],
    }


def _frames(index: int, first: Sequence[Observation], last: Sequence[Observation]) -> dict[str, Any]:
    return {"index": index, "first": [pack_frame(f) for f in first], "last": [pack_frame(f) for f in last]}


def generate(
    folder: Path,
    tasks: int,
    seed: int,
    workers: int,
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
        workers: processes.
        part: how many indices are made together, and lost together where the job is stopped.
        shard: which share to make, from 1, and of how many.
        frames: whether to keep the observations; without them, `render` makes them later.

    Returns:
        how many indices it took.

    Raises:
        DatasetError: the folder holds another data set, or other files.
    """
    _write_identity(folder, tasks, seed, part)
    share, shards = shard
    wanted = -(-tasks // shards)
    made: list[Part] = []
    while (missing := wanted - _distinct(made)) > 0:
        for _ in range(-(-missing // part)):
            made.append(Part(folder, seed, share - 1 + shards * len(made), part))
        make_parts(make_part, [Build(p, frames) for p in made], workers, "tasks", part)
    if shards == 1:
        _write_index(folder, made, tasks)
    return len(made) * part


def _write_identity(folder: Path, tasks: int, seed: int, part: int) -> None:
    made_by = {"evaps": version("evaps"), "vizdoom": version("vizdoom")}
    identity = {"format": FORMAT, "robot": ROBOT, "seed": seed, "tasks": tasks, **made_by}
    identity |= {"part": part} if part != PART else {}
    path = folder / "dataset.json"
    if path.exists():
        found = read_identity(folder)
        for key in ("format", "robot", "vizdoom", "seed", "part"):
            usual = PART if key == "part" else None
            there, wanted = found.get(key, usual), identity.get(key, usual)
            if there != wanted:
                raise DatasetError(f"{folder} has {key} {there}, not {wanted}; use another folder")
        if found.get("tasks", 0) > tasks:
            raise DatasetError(
                f"{folder} is for {found['tasks']} tasks; ask for as many, or use another folder"
            )
        identity["evaps"] = found.get("evaps")  # the version that began it
    elif folder.exists() and any(folder.iterdir()):
        raise DatasetError(f"{folder} is not empty and no data set; choose another folder")
    write_atomically(path, (json.dumps(identity, indent=1) + "\n").encode())


def _distinct(parts: Sequence[Part]) -> int:
    tables = [pq.read_table(part.path, columns=["program"]) for part in parts]
    return len(set(itertools.chain.from_iterable(t["program"].to_pylist() for t in tables)))


def _write_index(folder: Path, parts: Sequence[Part], tasks: int) -> None:
    """Join the parts into one file of distinct programs; parts that are not needed are removed."""
    kept: dict[str, dict[str, Any]] = {}
    for row in itertools.chain.from_iterable(map(_rows, parts)):
        kept.setdefault(row["program"], row)
    needed = {path for part in parts for path in (part.path, part.frames)}
    for path in (*folder.glob("parts/tasks-*.parquet"), *folder.glob("frames/frames-*.parquet")):
        if path not in needed:  # shards may have made a few more than one run needs
            path.unlink()
    write_table(folder / "tasks.parquet", list(kept.values())[:tasks], TASK_SCHEMA)


def _rows(part: Part) -> Iterator[dict[str, Any]]:
    yield from pq.read_table(part.path).to_pylist()


@dataclass(frozen=True)
class Rendering:
    """A part of a data set whose frames are to be made again."""

    part: Part

    @property
    def path(self) -> Path:
        """The file of the frames."""
        return self.part.frames


def render_part(robot: MemoRobot, rendering: Rendering) -> None:
    """Run the programs of a part again and write their first and last observations.

    Raises:
        DatasetError: a program no longer does what the data set says.
    """
    rows = []
    for row in _rows(rendering.part):
        robot.forget()
        traces = []
        for scene, actions in zip(row["scenes"], row["actions"], strict=True):
            robot.reset(Scene.from_json(scene))
            traces.append(run(Program.parse(row["program"]), robot))
            if " ".join(traces[-1].actions) != actions:
                raise DatasetError(f"task {row['index']} does not run as it did; generate the data set again")
        ends = ([t.observations[i] for t in traces] for i in (0, -1))
        rows.append(_frames(row["index"], *ends))
    write_table(rendering.path, rows, FRAME_SCHEMA)


def render(folder: Path, workers: int) -> int:
    """Make the frames that were left out, or go on with it; the same bytes as if they had been kept.

    Args:
        folder: of a data set.
        workers: processes.

    Returns:
        how many tasks have frames now.

    Raises:
        DatasetError: the folder holds no data set, or one of another robot or engine.
    """
    identity = read_identity(folder)
    size = identity.get("part", PART)
    _write_identity(folder, identity["tasks"], identity["seed"], size)
    numbers = sorted(int(path.stem.rpartition("-")[2]) for path in folder.glob("parts/tasks-*.parquet"))
    parts = [Rendering(Part(folder, 0, number, size)) for number in numbers]  # a shard's have gaps
    make_parts(render_part, parts, workers, "tasks", size)
    return len(parts) * size
