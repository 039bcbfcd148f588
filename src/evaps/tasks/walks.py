"""Random walks: what the encoder learns from first, since they cost almost nothing to simulate."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from evaps.dsl.sampler import ACTIONS, PERCEPTION_KEYS
from evaps.robots.base import Scene, WorldState
from evaps.robots.memo import MemoRobot
from evaps.robots.workers import Workers
from evaps.robots.world import world
from evaps.tasks.dataset import rows_bytes
from evaps.tasks.files import read_table
from evaps.tasks.frames import pack_frames
from evaps.tasks.identity import short_hash
from evaps.tasks.parts import Files, make_parts

LENGTH = 8  # actions in a walk
PART = 250  # walks in a file
SAME = 0.3  # how likely an action is the one before it

SCHEMA = pa.schema(
    {
        "actions": pa.list_(pa.int8()),
        "frames": pa.binary(),
        "perceptions": pa.list_(pa.list_(pa.bool_())),
        "poses": pa.list_(pa.list_(pa.float32(), 3)),
        "ammo": pa.list_(pa.int32()),
    }
)


Start = tuple[Scene, tuple[str, ...]]
"""A scene and the first actions of a walk."""


@dataclass(frozen=True)
class WalkPart:
    """Some walks of a data set, made together from (seed, number) and, if given, how they start."""

    folder: Path
    seed: int
    number: int
    starts: tuple[Start, ...] = ()

    @property
    def path(self) -> Path:
        """Where the walks are written."""
        key = short_hash([self.seed, [[scene.to_json(), actions] for scene, actions in self.starts]])
        return self.folder / f"walks-{self.number:05d}-{key}.parquet"


def make_walks(robot: MemoRobot, part: WalkPart) -> Files:
    """Simulate the walks of a part."""
    rng = np.random.default_rng([part.seed, 1, part.number])  # 1: not the stream of any task
    starts = part.starts or tuple((world().random_scene(rng), ()) for _ in range(PART))
    return {part.path: rows_bytes([_walk(robot, start, rng) for start in starts], SCHEMA)}


def _walk(robot: MemoRobot, start: Start, rng: np.random.Generator) -> dict[str, Any]:
    robot.forget()
    scene, first = start
    robot.reset(scene)
    actions = _actions([ACTIONS.index(action) for action in first], rng)
    frames, perceptions, states = [], [], []
    for action in [None, *actions]:
        if action is not None:
            robot.act(ACTIONS[action])
        frames.append(robot.observe().frame)
        perceptions.append([robot.perceive(p) for p in PERCEPTION_KEYS])
        states.append(robot.state())
    return {
        "actions": actions,
        "frames": pack_frames(frames),
        "perceptions": perceptions,
        "poses": [_pose(state) for state in states],
        "ammo": [state.ammo for state in states],
    }


def _actions(first: list[int], rng: np.random.Generator) -> list[int]:
    actions = list(first)
    while len(actions) < LENGTH:
        again = bool(actions) and rng.random() < SAME
        actions.append(actions[-1] if again else int(rng.integers(len(ACTIONS))))
    return actions[:LENGTH]


def _pose(state: WorldState) -> list[float]:
    return [state.robot.x, state.robot.y, state.robot.heading]


def generate_walks(
    folder: Path, walks: int, seed: int, workers: Workers, starts: Sequence[Start] = ()
) -> list[Path]:
    """Make random walks, or go on where it was interrupted.

    Args:
        folder: where to.
        walks: how many that are random from the start.
        seed: of the walks.
        workers: who makes them.
        starts: one more walk for each of these, which starts like that and goes on at random.

    Returns:
        the files that hold them, the random ones first.
    """
    parts = [WalkPart(folder, seed, n) for n in range(-(-walks // PART))]
    for i in range(0, len(starts), PART):
        parts.append(WalkPart(folder, seed, len(parts), tuple(starts[i : i + PART])))
    return make_parts(make_walks, parts, workers, "random walks", PART)


@dataclass(frozen=True)
class Walks:
    """Walks in memory; the frames of each stay packed."""

    frames: list[bytes]
    actions: np.ndarray[Any, np.dtype[np.int64]]  # [walk, action]
    perceptions: np.ndarray[Any, np.dtype[np.bool_]]  # [walk, time, perception]
    poses: np.ndarray[Any, np.dtype[np.float32]]  # [walk, time, 3]
    ammo: np.ndarray[Any, np.dtype[np.int64]]  # [walk, time]

    @classmethod
    def read(cls, paths: Sequence[Path]) -> Walks:
        """Read the files that `generate_walks` wrote."""
        rows = list(_rows(paths))
        columns = {key: np.array([row[key] for row in rows]) for key in SCHEMA.names if key != "frames"}
        frames = [row["frames"] for row in rows]
        actions, ammo = columns["actions"].astype(np.int64), columns["ammo"].astype(np.int64)
        return cls(frames, actions, columns["perceptions"], columns["poses"].astype(np.float32), ammo)


def _rows(paths: Sequence[Path]) -> Iterator[dict[str, Any]]:
    for path in paths:
        yield from read_table(path).to_pylist()
