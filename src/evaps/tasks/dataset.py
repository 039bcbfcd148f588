"""Data sets of tasks: Parquet files that anybody can open, made in parts, resumable."""

from __future__ import annotations

import hashlib
import itertools
import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from evaps.dsl import Program, UserError
from evaps.dsl.sampler import SamplerConfig
from evaps.files import write_atomically
from evaps.robots.base import Scene, WorldState
from evaps.robots.doom import ROBOT
from evaps.robots.memo import MemoRobot
from evaps.tasks.files import read_json
from evaps.tasks.frames import pack_frame, unpack_frame
from evaps.tasks.generate import Draft, generate_task
from evaps.tasks.parts import make_parts
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


def _rows(index: int, draft: Draft) -> tuple[dict[str, Any], dict[str, Any]]:
    task = {
        "index": index,
        "program": str(draft.program),
        "split": split_of(draft.program),
        "steps": draft.steps,
        "scenes": [scene.to_json() for scene in draft.scenes],
        "states": [state.to_json() for state in draft.states],
        "actions": [" ".join(actions) for actions in draft.actions],
    }
    first, last = ([pack_frame(f) for f in frames] for frames in (draft.first, draft.last))
    return task, {"index": index, "first": first, "last": last}


@dataclass(frozen=True)
class Part:
    """Some indices of a data set, made together."""

    folder: Path
    seed: int
    number: int
    size: int = PART
    config: SamplerConfig = field(default_factory=SamplerConfig)

    @property
    def path(self) -> Path:
        """Programs, scenes and outcomes; written after the frames."""
        return self.folder / "parts" / f"tasks-{self.number:05d}.parquet"

    @property
    def frames(self) -> Path:
        """First and last observations."""
        return self.folder / "frames" / f"frames-{self.number:05d}.parquet"


def make_part(robot: MemoRobot, part: Part) -> None:
    """Generate the tasks of a part and write its two files; frames first, so that the tasks mean: done."""
    indices = range(part.number * part.size, (part.number + 1) * part.size)
    rows = [_rows(i, generate_task(part.seed, i, robot, part.config)) for i in indices]
    write_table(part.frames, [frames for _, frames in rows], FRAME_SCHEMA)
    write_table(part.path, [task for task, _ in rows], TASK_SCHEMA)


def generate(folder: Path, tasks: int, seed: int, workers: int, part: int = PART) -> int:
    """Make a data set of so many tasks with distinct programs, or go on where it was interrupted.

    Tasks come in the order of their indices; of equal programs the first is kept.

    Args:
        folder: where to.
        tasks: how many.
        seed: of everything random.
        workers: processes.
        part: how many indices are made together, and lost together where the job is stopped.

    Returns:
        how many indices it took.

    Raises:
        DatasetError: the folder holds another data set, or other files.
    """
    _write_identity(folder, tasks, seed, part)
    number = 0
    while True:
        missing = max(1, -(-(tasks - _distinct(folder, number)) // part))
        wanted = [Part(folder, seed, n, part) for n in range(number, number + missing)]
        make_parts(make_part, wanted, workers, "tasks", part)
        number += missing
        if _distinct(folder, number) >= tasks:
            _write_index(folder, number, tasks)
            return number * part


def _write_identity(folder: Path, tasks: int, seed: int, part: int) -> None:
    made_by = {"evaps": version("evaps"), "vizdoom": version("vizdoom")}
    identity = {"format": FORMAT, "robot": ROBOT, "seed": seed, "tasks": tasks, **made_by}
    identity |= {"part": part} if part != PART else {}
    path = folder / "dataset.json"
    if path.exists():
        found = _read_identity(path)
        for key in ("format", "robot", "vizdoom", "seed", "part"):
            usual = PART if key == "part" else None
            there, wanted = found.get(key, usual), identity.get(key, usual)
            if there != wanted:
                raise DatasetError(f"{folder} has {key} {there}, not {wanted}; use another folder")
        identity["evaps"] = found.get("evaps")  # the version that began it
    elif folder.exists() and any(folder.iterdir()):
        raise DatasetError(f"{folder} is not empty and no data set; choose another folder")
    write_atomically(path, (json.dumps(identity, indent=1) + "\n").encode())


def _read_identity(path: Path) -> dict[str, Any]:
    found = read_json(path, DatasetError)
    if not isinstance(found, dict):
        raise DatasetError(f"{path}: expected an object with the seed and the size of a data set")
    return found


def _part_rows(folder: Path, number: int) -> Iterator[dict[str, Any]]:
    for n in range(number):
        yield from pq.read_table(Part(folder, 0, n).path).to_pylist()


def _distinct(folder: Path, number: int) -> int:
    tables = [pq.read_table(Part(folder, 0, n).path, columns=["program"]) for n in range(number)]
    return len(set(itertools.chain.from_iterable(t["program"].to_pylist() for t in tables)))


def _write_index(folder: Path, number: int, tasks: int) -> None:
    """Join the parts into one file of distinct programs."""
    kept: dict[str, dict[str, Any]] = {}
    for row in _part_rows(folder, number):
        kept.setdefault(row["program"], row)
    write_table(folder / "tasks.parquet", list(kept.values())[:tasks], TASK_SCHEMA)


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
        self.identity = _read_identity(self.folder / "dataset.json")
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
    """For each task with one of these indices: first and last observations of its examples, packed."""
    wanted = set(indices)
    size = _read_identity(folder / "dataset.json").get("part", PART)
    for number in sorted({index // size for index in wanted}):
        for row in pq.read_table(Part(folder, 0, number).frames).to_pylist():
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
