"""Ways on the tasks of a data set, recorded in parts: those of the gold programs, or those of a policy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import torch

from evaps.models.inferred_trace import InferredTraceConfig, Policy
from evaps.robots.memo import MemoRobot
from evaps.robots.workers import Workers
from evaps.synthesis.features import FeatureTable, array_bytes, encoder_of
from evaps.synthesis.ways import LONGEST, Way, WayTable, follow, gold_ways
from evaps.tasks.dataset import Dataset, TaskPart, rows_bytes, task_parts
from evaps.tasks.files import read_table
from evaps.tasks.parts import ROBOT, Files, make_parts
from evaps.tasks.task import EXAMPLES

TASKS = 50  # in a part
WAYS_ROBOT = replace(ROBOT, spares=EXAMPLES - 1)  # all scenes of a task go on together

_NUMBERS = pa.list_(pa.int32())
SCHEMA = pa.schema(
    {
        "rows": _NUMBERS,
        "perceived": _NUMBERS,
        "actions": _NUMBERS,
        "goal": pa.int32(),
        "reached": pa.bool_(),
    }
)


@dataclass(frozen=True)
class WayPart:
    """Some tasks, and who goes on their scenes.

    Attributes:
        tasks: the tasks, and the Parquet file to write; the embeddings lie beside it as ``.npy``.
        encoder: folder of the encoder's checkpoint.
        policy: file of the policy's weights; None for the gold programs.
        config: of the policy.
    """

    tasks: TaskPart
    encoder: Path
    policy: Path | None
    config: InferredTraceConfig

    @property
    def path(self) -> Path:
        """The Parquet file."""
        return self.tasks.path


def make_ways(robot: MemoRobot, part: WayPart) -> Files:
    """Go on the scenes of a part, and what was seen."""
    torch.set_num_threads(1)  # every worker has one core
    table = FeatureTable(encoder_of(part.encoder))
    ways: list[Way] = []
    for gold in part.tasks.golds():
        robot.forget()
        if part.policy is None:
            ways += gold_ways(gold.program, gold.task, robot, table)
        else:
            ways += follow(_policy(part.policy, part.config), gold.task, robot, table)
    embeddings = array_bytes(table.table.half().numpy())
    rows = [way._asdict() for way in ways]
    return {part.path.with_suffix(".npy"): embeddings, part.path: rows_bytes(rows, SCHEMA)}


@cache
def _policy(weights: Path, config: InferredTraceConfig) -> Policy:
    policy = Policy(config)
    policy.load_state_dict(torch.load(weights, map_location="cpu", weights_only=True))
    return policy.eval()


def record_ways(
    folder: Path,
    dataset: Dataset,
    encoder: Path,
    positions: Sequence[int],
    workers: Workers,
    config: InferredTraceConfig,
    policy: Path | None = None,
) -> WayTable:
    """Record the ways on tasks of a data set, or go on with it.

    Args:
        folder: of the parts.
        dataset: whose tasks.
        encoder: folder of the encoder's checkpoint.
        positions: of the tasks; the table has them in this order.
        workers: who goes.
        config: of the policy.
        policy: file of its weights; None for the gold programs.
    """
    parts = [
        WayPart(tasks, encoder, policy, config) for tasks in task_parts(folder, dataset, positions, TASKS)
    ]

    def load(part: WayPart) -> WayPart:
        return replace(part, tasks=part.tasks.loaded(dataset))

    return _read(make_parts(make_ways, parts, workers, "tasks with ways", TASKS, load, WAYS_ROBOT))


def _read(paths: Sequence[Path]) -> WayTable:
    ways: list[Way] = []
    tables: list[np.ndarray[Any, np.dtype[np.float16]]] = []
    offset = 0
    for path in paths:
        for row in read_table(path).to_pylist():
            way = Way(**row)
            ways.append(way._replace(rows=[r + offset for r in way.rows], goal=way.goal + offset))
        tables.append(np.load(path.with_suffix(".npy")))
        offset += len(tables[-1])
    tasks = [ways[i : i + EXAMPLES] for i in range(0, len(ways), EXAMPLES)]
    assert max(len(way.rows) for way in ways) <= LONGEST + 1
    return WayTable.of(tasks, torch.from_numpy(np.concatenate(tables)))
