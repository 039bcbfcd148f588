"""Data sets of tasks: Parquet files that anybody can open, made in parts, resumable."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from evaps.domain import CHOSEN, VARIABLE
from evaps.dsl import Program
from evaps.files import write_atomically
from evaps.robots.base import Scene, WorldState
from evaps.robots.frames import Observation
from evaps.robots.world import world
from evaps.tasks.files import read_table
from evaps.tasks.frames import pack_frames, unpack_frames
from evaps.tasks.manifest import FORMAT, PART, DatasetError, read_identity
from evaps.tasks.task import GoldTask, Outcome

SPLITS = {"train": 0.7, "validation": 0.9, "test": 1.0}  # upper end of the hash


def split_of(program: Program | str) -> str:
    """The split of a program: 70 % train, 20 % validation, 10 % test, by a hash of its tokens."""
    share = int.from_bytes(hashlib.sha256(str(program).encode()).digest()[:8], "big") / 2**64
    return next(name for name, end in SPLITS.items() if share < end)


def table_bytes(table: pa.Table) -> bytes:
    """A table as a Parquet file: the same bytes for the same content."""
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd", compression_level=9)
    return sink.getvalue().to_pybytes()  # type: ignore[no-any-return]


def rows_bytes(rows: Sequence[Mapping[str, Any]], schema: pa.Schema) -> bytes:
    """Rows as a Parquet file."""
    return table_bytes(pa.Table.from_pylist(rows, schema))


def write_table(path: Path, rows: Sequence[Mapping[str, Any]], schema: pa.Schema) -> None:
    """Write rows as Parquet, whole or not at all."""
    write_atomically(path, rows_bytes(rows, schema))


_POSE = {"x": pa.float32(), "y": pa.float32(), "heading": pa.float32()}
_THING = {"kind": pa.string(), "x": pa.float32(), "y": pa.float32()}
_SCENE = pa.struct({"robot": pa.struct(_POSE), "things": pa.list_(pa.struct(_THING))})
_THINGS = pa.list_(pa.struct({**_THING, "alive": pa.bool_()}))
_STATE = pa.struct({**_POSE, "ammo": pa.int32(), "health": pa.int32(), "things": _THINGS})
TASK_SCHEMA = pa.schema(
    {
        "index": pa.int64(),
        "program": pa.string(),
        "split": pa.string(),
        "steps": pa.int32(),
        "scenes": pa.list_(_SCENE),
        "states": pa.list_(_STATE),
        "actions": pa.list_(pa.string()),
        "first_digests": pa.list_(pa.binary()),
        "last_digests": pa.list_(pa.binary()),
    }
)
FRAME_SCHEMA = pa.schema({"index": pa.int64(), "frames": pa.binary()})  # see `pack_frames`
TRACE_SCHEMA = pa.schema(
    {
        "index": pa.int64(),
        "observations": pa.list_(pa.binary()),  # of each example, before the first action and after each
        "perceptions": pa.list_(pa.list_(pa.list_(pa.string()))),  # those that are true in them
    }
)


def frame_row(index: int, first: Sequence[Observation], last: Sequence[Observation]) -> dict[str, Any]:
    """The first and then the last observations of a task, packed: a row of ``FRAME_SCHEMA``."""
    return {"index": index, "frames": pack_frames([*first, *last])}


@dataclass(frozen=True)
class Part:
    """Some indices of a data set, made together."""

    folder: Path
    seed: int
    number: int
    size: int = PART

    @property
    def indices(self) -> range:
        """The indices."""
        return range(self.number * self.size, (self.number + 1) * self.size)

    @property
    def path(self) -> Path:
        """Programs, scenes and outcomes; written after the frames."""
        return self.folder / "parts" / f"tasks-{self.number:05d}.parquet"

    @property
    def frames(self) -> Path:
        """First and last observations."""
        return self.folder / "frames" / f"frames-{self.number:05d}.parquet"

    @property
    def traces(self) -> Path:
        """All observations of the runs."""
        return self.folder / "traces" / f"traces-{self.number:05d}.parquet"


class Rows(Sequence[dict[str, Any]]):
    """The rows of a table as plain values, each made when it is asked for."""

    def __init__(self, table: pa.Table) -> None:
        self.table = table

    def __len__(self) -> int:
        return int(self.table.num_rows)

    def __getitem__(self, position: Any) -> Any:
        if isinstance(position, slice):
            return [self[i] for i in range(*position.indices(len(self)))]
        if not -len(self) <= position < len(self):
            raise IndexError(position)
        return self.table.slice(position % len(self), 1).to_pylist()[0]

    def column(self, name: str) -> list[Any]:
        """One value of every row."""
        values: list[Any] = self.table[name].to_pylist()
        return values


class Dataset:
    """A data set on disk.

    Args:
        folder: what ``evaps generate`` wrote.

    Attributes:
        identity: seed, size and versions, as in ``dataset.json``.
        rows: all tasks, without frames, in the order of their indices.

    Raises:
        DatasetError: the folder holds no complete data set.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        if not (self.folder / "tasks.parquet").exists():
            raise DatasetError(f"{folder} holds no complete data set; make one with: evaps generate {folder}")
        self.identity = read_identity(self.folder)
        if (robot := self.identity.get("robot")) != world().version:
            raise DatasetError(
                f"{folder} is of the robot {robot!r}, and this is the domain {CHOSEN.name} with "
                f"{world().version!r}; set {VARIABLE} to the right one, or generate it again"
            )
        if (found := self.identity.get("format")) != FORMAT:
            raise DatasetError(f"{folder} has the format {found!r}, not {FORMAT!r}; generate it again")
        self.rows = Rows(read_table(self.folder / "tasks.parquet", DatasetError))
        if len(self.rows) != (tasks := self.identity.get("tasks")):
            raise DatasetError(
                f"{folder} has {len(self.rows)} of {tasks} tasks; go on with: "
                f"evaps generate {folder} --tasks {tasks} --seed {self.identity.get('seed')}"
            )

    def __len__(self) -> int:
        return len(self.rows)

    def split(self, name: str) -> list[int]:
        """The positions in `rows` of the tasks of a split."""
        return [i for i, split in enumerate(self.rows.column("split")) if split == name]

    def frames(self, positions: Sequence[int]) -> Iterator[tuple[int, bytes]]:
        """For each position (in order of the files): first and then last observations, packed together."""
        indices = self.rows.column("index")
        wanted = {indices[p]: p for p in positions}
        for index, frames in read_frames(self.folder, list(wanted)):
            yield wanted[index], frames


def read_frames(folder: Path, indices: Sequence[int]) -> Iterator[tuple[int, bytes]]:
    """For each task with one of these indices: first and then last observations of its examples, packed.

    Raises:
        DatasetError: the frames were left out.
    """
    wanted, found = set(indices), set()
    size = read_identity(folder).get("part", PART)
    for number in sorted({index // size for index in wanted}):
        path = Part(folder, 0, number).frames
        if not path.exists():
            raise DatasetError(f"{path} is missing; make the frames with: evaps render {folder}")
        for row in read_table(path, DatasetError).to_pylist():
            if row["index"] in wanted:
                found.add(row["index"])
                yield row["index"], row["frames"]
    if missing := wanted - found:
        raise DatasetError(
            f"frames of {len(missing)} tasks are missing; make them with: evaps render {folder}"
        )


def gold_task(row: dict[str, Any], frames: bytes) -> GoldTask:
    """A task with its answer from its row and its packed frames."""
    goals = unpack_frames(frames)[len(row["scenes"]) :]
    outcomes = tuple(
        Outcome(Scene.from_json(scene), goal, WorldState.from_json(state))
        for scene, goal, state in zip(row["scenes"], goals, row["states"], strict=True)
    )
    return GoldTask(f"task-{row['index']}", Program.parse(row["program"]), outcomes, row["steps"])


@dataclass(frozen=True)
class TaskPart:
    """Some tasks of a data set, and the file that is made of them.

    Attributes:
        path: the file.
        folder: of the data set.
        positions: of the tasks in `Dataset.rows`.
        rows: the tasks, as in `Dataset.rows`; empty until they are loaded.
        frames: their observations, packed.
    """

    path: Path
    folder: Path
    positions: tuple[int, ...]
    rows: tuple[dict[str, Any], ...] = ()
    frames: tuple[bytes, ...] = ()

    def loaded(self, dataset: Dataset) -> TaskPart:
        """The same with rows and frames: it needs no files any more.

        Raises:
            DatasetError: the frames were left out.
        """
        rows = tuple(dataset.rows[p] for p in self.positions)
        frames = dict(read_frames(self.folder, [row["index"] for row in rows]))
        return replace(self, rows=rows, frames=tuple(frames[row["index"]] for row in rows))

    def golds(self) -> Iterator[GoldTask]:
        """The tasks with their answers."""
        return map(gold_task, self.rows, self.frames)


def task_parts(folder: Path, dataset: Dataset, positions: Sequence[int], size: int) -> Iterator[TaskPart]:
    """Tasks of a data set in parts of ``size``, whose files are numbered in ``folder``."""
    for number, start in enumerate(range(0, len(positions), size)):
        path = folder / f"part-{number:05d}.parquet"
        yield TaskPart(path, dataset.folder, tuple(positions[start : start + size]))
