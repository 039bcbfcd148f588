"""What a repairer learns from: wrong programs on training tasks, and what the robot saw when it ran them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import torch

from evaps.dsl import Program
from evaps.dsl.mutation import mutate
from evaps.models.base import Execution
from evaps.robots.memo import MemoRobot
from evaps.robots.workers import Workers
from evaps.synthesis.features import FeatureTable, array_bytes, encoder_of
from evaps.synthesis.solution import attempt_all
from evaps.tasks.dataset import Dataset, TaskPart, rows_bytes, task_parts
from evaps.tasks.files import read_table
from evaps.tasks.parts import Files, make_parts
from evaps.tasks.task import GoldTask

TASKS = 50  # in a part
MUTATIONS = (1, 2, 3)  # how many at once, and their weights 1 : 2 : 3 (Gupta et al., 2020)

_ROWS = pa.list_(pa.list_(pa.int32()))
SCHEMA = pa.schema(
    {
        "task": pa.int64(),
        "program": pa.string(),
        "target": pa.string(),
        "stage": pa.int8(),
        "before": _ROWS,
        "after": _ROWS,
        "ends": _ROWS,
        "events": _ROWS,
    }
)


@dataclass(frozen=True)
class MistakePart:
    """Some training tasks and the wrong programs to run on them.

    Attributes:
        tasks: the tasks, and the Parquet file to write; the embeddings lie beside it as ``.npy``.
        encoder: folder of the encoder's checkpoint.
        mutations: how many mutations of each gold program are run (stage 1).
        seed: of the mutations.
        failures: for each task, programs of the synthesizer (stage 2); those that are right are left out.
            Empty until it is loaded.
    """

    tasks: TaskPart
    encoder: Path
    mutations: int
    seed: int
    failures: Sequence[Sequence[str]] = ()

    @property
    def path(self) -> Path:
        """The Parquet file."""
        return self.tasks.path


def make_mistakes(robot: MemoRobot, part: MistakePart) -> Files:
    """Run the wrong programs of a part; what was seen."""
    torch.set_num_threads(1)  # every worker has one core
    table = FeatureTable(encoder_of(part.encoder))
    rng = np.random.default_rng([part.seed, 2, part.tasks.rows[0]["index"]])
    rows: list[dict[str, Any]] = []
    for gold, failures in zip(part.tasks.golds(), part.failures, strict=True):
        robot.forget()
        rows += _mistakes(gold, failures, part.mutations, robot, table, rng)
    embeddings = array_bytes(table.table.half().numpy())
    return {part.path.with_suffix(".npy"): embeddings, part.path: rows_bytes(rows, SCHEMA)}


def _mistakes(
    gold: GoldTask,
    failures: Sequence[str],
    mutations: int,
    robot: MemoRobot,
    table: FeatureTable,
    rng: np.random.Generator,
) -> list[dict[str, Any]]:
    programs = {mutate(gold.program, rng, n): 1 for n in how_often(mutations, rng)}
    programs |= {Program.parse(text): 2 for text in failures}
    attempts = attempt_all(list(programs), gold.task, robot)
    wrong = [a for a in attempts if not a.solved]
    return [
        {
            "task": int(gold.name.removeprefix("task-")),
            "program": str(e.program),
            "target": str(gold.program),
            "stage": programs[e.program],
            "before": e.before.tolist(),
            "after": e.after.tolist(),
            "ends": [e.first.tolist(), e.final.tolist(), e.goal.tolist()],
            "events": e.events.tolist(),
        }
        for e in table.executions(wrong, gold.task)
    ]


def how_often(mutations: int, rng: np.random.Generator) -> list[int]:
    """How many mutations are made at once in each of some mutated programs: see MUTATIONS."""
    weights = np.array(MUTATIONS) / sum(MUTATIONS)
    return [int(n) for n in rng.choice(MUTATIONS, size=mutations, p=weights)]


def generate_mistakes(
    folder: Path,
    dataset: Dataset,
    encoder: Path,
    positions: Sequence[int],
    failures: Callable[[Sequence[int]], Sequence[Sequence[str]]],
    mutations: int,
    seed: int,
    workers: Workers,
) -> list[Path]:
    """Run wrong programs on tasks of a data set, or go on with it; the files that hold them.

    Args:
        folder: of the files.
        dataset: where the tasks are.
        encoder: folder of the encoder's checkpoint.
        positions: of the tasks.
        failures: programs of the synthesizer for each of some tasks, by their positions; called just before
            these are run.
        mutations: of each gold program.
        seed: of the mutations.
        workers: who runs them.
    """
    parts = [
        MistakePart(tasks, encoder, mutations, seed)
        for tasks in task_parts(folder, dataset, positions, TASKS)
    ]

    def load(part: MistakePart) -> MistakePart:
        return replace(part, tasks=part.tasks.loaded(dataset), failures=failures(part.tasks.positions))

    return make_parts(make_mistakes, parts, workers, "tasks with mistakes", TASKS, load)


@dataclass(frozen=True)
class Mistakes:
    """Wrong programs in memory.

    Attributes:
        tasks: the index of the task that each belongs to.
        executions: rows count through `table`.
        targets: the right program of each.
        stages: 1 for a mutation, 2 for a failure of the synthesizer.
        table: embeddings, float16 ``[row, feature]``.
    """

    tasks: list[int]
    executions: list[Execution]
    targets: list[Program]
    stages: list[int]
    table: np.ndarray[Any, np.dtype[np.float16]]

    @classmethod
    def read(cls, paths: Sequence[Path]) -> Mistakes:
        """Read the files that `generate_mistakes` wrote."""
        tasks: list[int] = []
        executions: list[Execution] = []
        targets: list[Program] = []
        stages: list[int] = []
        tables: list[np.ndarray[Any, np.dtype[np.float16]]] = []
        offset = 0
        for path in paths:
            for row in read_table(path).to_pylist():
                tasks.append(row["task"])
                executions.append(_execution(row, offset))
                targets.append(Program.parse(row["target"]))
                stages.append(row["stage"])
            tables.append(np.load(path.with_suffix(".npy")))
            offset += len(tables[-1])
        return cls(tasks, executions, targets, stages, np.concatenate(tables))


def _execution(row: dict[str, Any], offset: int) -> Execution:
    before, after = (np.array(row[key]) for key in ("before", "after"))
    shifted = [np.where(rows < 0, -1, rows + offset) for rows in (before, after)]
    events = np.add(np.array(row["events"], np.int64).reshape(-1, 3), [0, 0, offset])
    ends = np.array(row["ends"]) + offset
    return replace(Execution(Program.parse(row["program"]), *shifted, *ends), events=events)
