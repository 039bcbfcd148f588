"""What is in a data set, and whether it still holds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from evaps.dsl.sampler import ACTIONS, PERCEPTION_KEYS
from evaps.robots.base import WorldState
from evaps.robots.frames import digest
from evaps.robots.memo import MemoRobot
from evaps.tasks.dataset import SPLITS, Dataset, read_frames
from evaps.tasks.frames import unpack_frames
from evaps.tasks.manifest import PART, DatasetError
from evaps.tasks.render import run_again

STEP_BUCKETS = ("2", "3", "4", "5", "6", "7+")


def step_bucket(steps: int) -> str:
    """In which of STEP_BUCKETS a task of so many steps is."""
    return STEP_BUCKETS[min(max(steps, 2), 7) - 2]


@dataclass(frozen=True)
class Summary:
    """What is in a data set.

    Attributes:
        identity: seed, size and versions.
        splits: tasks in each split.
        tokens: of the programs: least, mean, most.
        steps: of the tasks: least, mean, most.
        buckets: tasks by steps: 2, 3, 4, 5, 6, 7+.
        control: programs with each kind of control flow, and with none.
        perceptions: programs that ask for each.
        actions: programs that execute each.
        bytes_per_task: of ``tasks.parquet``, and of each folder of frames that is there.
    """

    identity: Mapping[str, Any]
    splits: Mapping[str, int]
    tokens: tuple[int, float, int]
    steps: tuple[int, float, int]
    buckets: Mapping[str, int]
    control: Mapping[str, int]
    perceptions: Mapping[str, int]
    actions: Mapping[str, int]
    bytes_per_task: Mapping[str, float]


def summarize(dataset: Dataset) -> Summary:
    """Count what is in a data set."""
    programs = [program.split() for program in dataset.rows.column("program")]
    steps = dataset.rows.column("steps")
    words = [set(tokens) for tokens in programs]
    kinds = ("IF", "IFELSE", "WHILE", "REPEAT", "not")
    control = {kind: sum(kind in found for found in words) for kind in kinds}
    control["none"] = sum(not found & {*kinds} for found in words)
    asked = [{*tokens, *map(" ".join, pairwise(tokens))} for tokens in programs]
    splits = Counter(dataset.rows.column("split"))
    found = Counter(map(step_bucket, steps))
    return Summary(
        dataset.identity,
        {split: splits[split] for split in SPLITS},
        _range([len(tokens) for tokens in programs]),
        _range(steps),
        {bucket: found[bucket] for bucket in STEP_BUCKETS},
        control,
        {key: sum(key in pairs for pairs in asked) for key in PERCEPTION_KEYS},
        {action: sum(action in found for found in words) for action in ACTIONS},
        dict(_sizes(dataset)),
    )


def _range(values: Sequence[int]) -> tuple[int, float, int]:
    return min(values), float(np.mean(values)), max(values)


def _sizes(dataset: Dataset) -> list[tuple[str, float]]:
    sizes = [("tasks.parquet", (dataset.folder / "tasks.parquet").stat().st_size / len(dataset))]
    per_part = dataset.identity.get("part", PART)
    for room in ("frames", "traces"):
        files = list((dataset.folder / room).glob("*.parquet"))
        if files:
            sizes.append((room, sum(f.stat().st_size for f in files) / (len(files) * per_part)))
    return sizes


def check(dataset: Dataset, count: int, robot: MemoRobot) -> list[str]:
    """Run a sample of tasks again; what differs from the data set, a line each.

    Args:
        dataset: whose tasks.
        count: how many, evenly spread.
        robot: where they run.
    """
    positions = np.linspace(0, len(dataset) - 1, min(count, len(dataset))).round().astype(int)
    faults = []
    for position in positions:
        row = dataset.rows[int(position)]
        states = [WorldState.from_json(state) for state in row["states"]]
        try:
            for state, _ in zip(states, run_again(row, robot), strict=True):
                if not _same(robot.state(), state):
                    raise DatasetError(f"task {row['index']} does not end as it did")
            _check_frames(dataset, row)
        except DatasetError as fault:
            faults.append(str(fault))
    return faults


def _check_frames(dataset: Dataset, row: Mapping[str, Any]) -> None:
    """The frames of a task are those that its digests say, unless they were left out.

    Raises:
        DatasetError: they are not, or cannot be read.
    """
    if not (dataset.folder / "frames").is_dir():
        return
    for _, frames in read_frames(dataset.folder, [row["index"]]):
        if [digest(f) for f in unpack_frames(frames)] != [*row["first_digests"], *row["last_digests"]]:
            raise DatasetError(f"the frames of task {row['index']} are not its own; delete and render them")


def _same(a: WorldState, b: WorldState) -> bool:
    """Equal but for what is lost where numbers are stored with 32 bits."""
    counted = (a.ammo, a.health, _kinds(a)) == (b.ammo, b.health, _kinds(b))
    return counted and bool(np.allclose(_numbers(a), _numbers(b), atol=0.01))


def _kinds(state: WorldState) -> list[tuple[str, bool]]:
    return [(thing.kind, thing.alive) for thing in state.things]


def _numbers(state: WorldState) -> list[float]:
    robot = state.robot
    return [robot.x, robot.y, robot.heading, *(n for t in state.things for n in (t.x, t.y))]
