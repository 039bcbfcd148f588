"""Data sets of tasks: Parquet files that anybody can open, made in parts, resumable."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from evaps.dsl import Program, UserError
from evaps.files import write_atomically
from evaps.robots.base import Scene, WorldState
from evaps.robots.doom import ROBOT
from evaps.tasks.files import read_json
from evaps.tasks.frames import unpack_frame
from evaps.tasks.task import GoldTask, Outcome

FORMAT = 1
PART = 100  # indices in a part, unless dataset.json says otherwise
SPLITS = {"train": 0.7, "validation": 0.9, "test": 1.0}  # upper end of the hash


class DatasetError(UserError):
    """A folder that is no data set, or not the one that was asked for; one line."""


def split_of(program: Program | str) -> str:
    """The split of a program: 70 % train, 20 % validation, 10 % test, by a hash of its tokens."""
    share = int.from_bytes(hashlib.sha256(str(program).encode()).digest()[:8], "big") / 2**64
    return next(name for name, end in SPLITS.items() if share < end)


def write_table(path: Path, rows: list[dict[str, Any]], schema: pa.Schema) -> None:
    """Write rows as Parquet, whole or not at all."""
    sink = pa.BufferOutputStream()
    pq.write_table(pa.Table.from_pylist(rows, schema), sink, compression="zstd")
    write_atomically(path, sink.getvalue().to_pybytes())


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
    }
)
FRAME_SCHEMA = pa.schema({"index": pa.int64(), "first": pa.list_(pa.binary()), "last": pa.list_(pa.binary())})


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


def read_identity(folder: Path) -> dict[str, Any]:
    """What ``dataset.json`` says: seed, size, robot and versions.

    Raises:
        DatasetError: it is missing or no object.
    """
    path = folder / "dataset.json"
    found = read_json(path, DatasetError)
    if not isinstance(found, dict):
        raise DatasetError(f"{path}: expected an object with the seed and the size of a data set")
    return found


class Dataset:
    """A data set on disk.

    Args:
        folder: what ``evaps generate`` wrote.

    Attributes:
        identity: seed, size and versions, as in ``dataset.json``.
        rows: all tasks as plain values, without frames, in the order of their indices.

    Raises:
        DatasetError: the folder holds no complete data set.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        if not (self.folder / "tasks.parquet").exists():
            raise DatasetError(f"{folder} holds no complete data set; make one with: evaps generate {folder}")
        self.identity = read_identity(self.folder)
        if self.identity.get("robot") != ROBOT:
            raise DatasetError(f"{folder} is of the robot {self.identity.get('robot')!r}, not {ROBOT!r}")
        self.rows: list[dict[str, Any]] = pq.read_table(self.folder / "tasks.parquet").to_pylist()

    def __len__(self) -> int:
        return len(self.rows)

    def split(self, name: str) -> list[int]:
        """The positions in :attr:`rows` of the tasks of a split."""
        return [i for i, row in enumerate(self.rows) if row["split"] == name]

    def frames(self, positions: Sequence[int]) -> Iterator[tuple[int, list[bytes], list[bytes]]]:
        """For each position (in order of the files): first and last observations of the examples, packed."""
        wanted = {self.rows[p]["index"]: p for p in positions}
        for index, first, last in read_frames(self.folder, list(wanted)):
            yield wanted[index], first, last


def read_frames(folder: Path, indices: Sequence[int]) -> Iterator[tuple[int, list[bytes], list[bytes]]]:
    """For each task with one of these indices: first and last observations of its examples, packed.

    Raises:
        DatasetError: the frames were left out.
    """
    wanted = set(indices)
    size = read_identity(folder).get("part", PART)
    for number in sorted({index // size for index in wanted}):
        path = Part(folder, 0, number).frames
        if not path.exists():
            raise DatasetError(f"{path} is missing; make the frames with: evaps render {folder}")
        for row in pq.read_table(path).to_pylist():
            if row["index"] in wanted:
                yield row["index"], row["first"], row["last"]


def gold_task(row: dict[str, Any], last: Sequence[bytes]) -> GoldTask:
    """A task with its answer from its row and its packed goal frames."""
    outcomes = tuple(
        Outcome(Scene.from_json(scene), unpack_frame(frame), WorldState.from_json(state))
        for scene, frame, state in zip(row["scenes"], last, row["states"], strict=True)
    )
    return GoldTask(f"task-{row['index']}", Program.parse(row["program"]), outcomes, row["steps"])


@dataclass(frozen=True)
class TaskPart:
    """Some tasks of a data set, and the file that is made of them.

    Attributes:
        path: the file.
        folder: of the data set.
        positions: of the tasks in :attr:`Dataset.rows`.
        rows: the tasks, as in :attr:`Dataset.rows`.
    """

    path: Path
    folder: Path
    positions: tuple[int, ...]
    rows: tuple[dict[str, Any], ...]

    def golds(self) -> Iterator[GoldTask]:
        """The tasks with their answers."""
        goals = {index: last for index, _, last in read_frames(self.folder, [r["index"] for r in self.rows])}
        return (gold_task(row, goals[row["index"]]) for row in self.rows)


def task_parts(folder: Path, dataset: Dataset, positions: Sequence[int], size: int) -> Iterator[TaskPart]:
    """Tasks of a data set in parts of ``size``, whose files are numbered in ``folder``."""
    for number, start in enumerate(range(0, len(positions), size)):
        chosen = tuple(positions[start : start + size])
        path = folder / f"part-{number:05d}.parquet"
        yield TaskPart(path, dataset.folder, chosen, tuple(dataset.rows[p] for p in chosen))
