"""How good candidates are: exact, semantic and generalization match, for each task and rank."""

from __future__ import annotations

import math
import os
import platform
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import pyarrow as pa
import torch

from evaps.domain import CHOSEN
from evaps.dsl import Program, UserError, run
from evaps.files import write_atomically
from evaps.models import Model, load_model, model_folder, needed_for
from evaps.models.checkpoint import hash_of, read_config
from evaps.models.compute import precision
from evaps.robots.base import state_match
from evaps.robots.frames import frame_match
from evaps.robots.memo import MemoRobot
from evaps.robots.workers import TWO, Workers
from evaps.synthesis import SPARES, Budget, solve
from evaps.synthesis.solution import Attempt, Solution
from evaps.tasks.dataset import SPLITS, Dataset, TaskPart, rows_bytes, table_bytes, task_parts
from evaps.tasks.files import read_table
from evaps.tasks.identity import code_version, short_hash
from evaps.tasks.parts import ROBOT as USUAL_ROBOT
from evaps.tasks.parts import Files, make_parts
from evaps.tasks.progress import note
from evaps.tasks.task import EXAMPLES, GoldTask

PART = 25  # tasks in a part
ROBOT = replace(USUAL_ROBOT, spares=SPARES)

ATTEMPT = pa.struct(
    {
        "program": pa.string(),
        "pairs_passed": pa.int32(),
        "semantic_state": pa.bool_(),
        "generalization_state": pa.bool_(),
    }
)
SCHEMA = pa.schema(
    {
        "method": pa.string(),
        "seed": pa.int32(),  # of the training
        "scale": pa.string(),
        "trained_on": pa.int64(),  # tasks in the data set of the training, all splits together
        "commit": pa.string(),  # of the training
        "weights": pa.string(),  # hash of all that the method's answers depend on
        "evaluated_by": pa.string(),  # commit of the evaluating code
        "machine": pa.string(),
        "dataset_seed": pa.int64(),
        "split": pa.string(),
        "noise": pa.float32(),  # share of the pixels that were invalid
        "budget": pa.int64(),  # actions that a search may simulate
        "top_k": pa.int32(),  # candidates that were asked for
        "most_rounds": pa.int32(),  # of repair that each might have
        "task": pa.int64(),
        "steps": pa.int32(),
        "rank": pa.int32(),
        "program": pa.string(),
        "exact": pa.bool_(),
        "semantic_state": pa.bool_(),
        "generalization_state": pa.bool_(),
        "semantic_frame": pa.bool_(),
        "generalization_frame": pa.bool_(),
        "pairs_passed": pa.int32(),
        "rounds": pa.int32(),
        "attempts": pa.list_(ATTEMPT),  # the proposal, and what it was after each round of repair
        "simulated_actions": pa.int64(),
        "seconds": pa.float32(),
        "confidence": pa.float32(),  # of verified synthesis in its answer; else null
    }
)


@dataclass(frozen=True)
class Match:
    """How a program's outcomes compare with the gold program's, over all six examples."""

    exact: bool
    semantic_state: bool
    generalization_state: bool
    semantic_frame: bool
    generalization_frame: bool


def match(program: Program, gold: GoldTask, robot: MemoRobot) -> Match:
    """Run a program on all six scenes and compare it with the gold program's outcomes."""
    states, frames = [], []
    for outcome in gold.outcomes:
        robot.reset(outcome.scene)
        halted = run(program, robot).halted
        states.append(halted and state_match(robot.state(), outcome.state))
        frames.append(halted and frame_match(robot.observe(), outcome.goal))
    spec = slice(EXAMPLES)
    return Match(program == gold.program, all(states[spec]), all(states), all(frames[spec]), all(frames))


@dataclass(frozen=True)
class Setting:
    """How methods are judged; the names are those of the rows' columns."""

    split: str
    noise: float
    budget: int
    top_k: int
    most_rounds: int


@dataclass(frozen=True)
class EvaluationPart:
    """Some tasks and the models to try on them."""

    tasks: TaskPart
    model: str
    facts: dict[str, dict[str, Any]]
    setting: Setting

    @property
    def path(self) -> Path:
        """The file of its rows."""
        return self.tasks.path


def evaluate_part(robot: MemoRobot, part: EvaluationPart) -> Files:
    """Synthesize and judge; the rows of a part.

    Each method begins with a robot that remembers nothing, so that none pays for what another one simulated;
    a task is judged only when all of them are done with it.
    """
    torch.set_num_threads(1)  # every worker has one core
    setting = part.setting
    budget = Budget(setting.budget, math.inf)  # what comes out must not depend on how busy the machine is
    rows: list[dict[str, Any]] = []
    for gold in part.tasks.golds():
        solutions = {}
        task = gold.task.with_noise(setting.noise) if setting.noise else gold.task
        for method in part.facts:
            robot.forget()
            model = _model(part.model, method)
            seed = part.facts[method]["seed"]  # of the training, and of what a search draws
            solutions[method] = solve(model, task, robot, setting.top_k, setting.most_rounds, budget, seed)
        for method, solution in solutions.items():
            rows += _rows(solution, gold, robot, part.facts[method])
    return {part.path: rows_bytes(rows, SCHEMA)}


@cache
def _model(folder: str, method: str) -> Model:
    return load_model(folder, method)


def _facts(model: str, method: str, dataset: Dataset, setting: Setting) -> dict[str, Any]:
    """What a row says of its making.

    Raises:
        CheckpointError: a checkpoint is missing.
    """
    folder = model_folder(model)
    needed = dict.fromkeys(needed_for(method))
    weights = [hash_of(folder / name) for name in needed]
    made = read_config(folder / list(needed)[-1], list(needed)[-1])["facts"]
    return {
        "method": method,
        **{key: made.get(key) for key in ("seed", "scale", "commit")},
        "trained_on": made.get("dataset", {}).get("tasks"),
        "weights": short_hash(weights),
        "evaluated_by": code_version(),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores, {precision()}",
        "dataset_seed": dataset.identity["seed"],
        **vars(setting),
    }


def _rows(
    solution: Solution, gold: GoldTask, robot: MemoRobot, facts: dict[str, Any]
) -> list[dict[str, Any]]:
    judged = cache(lambda program: match(program, gold, robot))
    return [
        {
            **facts,
            "task": int(gold.name.removeprefix("task-")),
            "steps": gold.steps,
            "rank": candidate.rank,
            "program": str(candidate.program),
            **vars(judged(candidate.program)),
            "pairs_passed": candidate.final.pairs_passed,
            "rounds": len(candidate.attempts) - 1,
            "attempts": [_attempt(a, judged(a.program)) for a in candidate.attempts],
            "simulated_actions": solution.simulated_actions,
            "seconds": solution.seconds,
            "confidence": solution.confidence,
        }
        for candidate in sorted(solution.all_candidates, key=lambda c: c.rank)
    ]


def _attempt(attempt: Attempt, found: Match) -> dict[str, Any]:
    return {
        "program": str(attempt.program),
        "pairs_passed": attempt.pairs_passed,
        "semantic_state": found.semantic_state,
        "generalization_state": found.generalization_state,
    }


def evaluate(
    data: Path,
    out: Path,
    model: str = CHOSEN.model,
    methods: Sequence[str] = ("lgrl", "evaps", "verified"),
    split: str = "test",
    tasks: int = 1000,
    top_k: int = 20,
    rounds: int = 5,
    workers: Workers = TWO,
    noise: float = 0.0,
    actions: int = CHOSEN.budget,
) -> Path:
    """Judge methods on the first tasks of a split, or go on where it was interrupted.

    A file that has these rows already, of the same code, data and weights, stays as it is.

    Args:
        data: folder of a data set.
        out: the file of rows to write, one for each method, task and rank.
        model: a shipped set of checkpoints, or a folder of them.
        methods: names in METHODS or SEARCHES; a repairer works on LGRL's candidates, or, as
            ``synthesizer+repairer``, on that one's.
        split: of the data set.
        tasks: how many; all, and a line says so, where there are fewer.
        top_k: candidates of a task.
        rounds: of repair.
        workers: who does it.
        noise: share of the pixels that are invalid in all that methods see.
        actions: that a search may simulate for a task; nobody else looks at it.

    Raises:
        UserError: no method, an unknown one, or an unknown split.
        CheckpointError: the model cannot be loaded.
    """
    if not methods:
        raise UserError("there is no method to judge; name some, such as --methods lgrl evaps")
    for method in methods:
        needed_for(method)
    dataset = Dataset(data)
    if split not in SPLITS:
        raise UserError(f"there is no split {split!r}; there are {', '.join(SPLITS)}")
    positions = dataset.split(split)[:tasks]
    if not positions:
        raise UserError(f"the data set has no task in the split {split!r}; generate a larger one")
    if len(positions) < tasks:
        note(f"the split {split!r} of {data} has {len(positions)} tasks; all of them are judged")
    setting = Setting(split, noise, actions, top_k, rounds)
    facts = {method: _facts(model, method, dataset, setting) for method in methods}
    if _are_there(out, facts, [dataset.rows[position]["index"] for position in positions]):
        return out
    folder = out.with_suffix(f".parts-{short_hash([dataset.identity, facts, positions])}")
    parts = [
        EvaluationPart(part, model, facts, setting) for part in task_parts(folder, dataset, positions, PART)
    ]

    def load(part: EvaluationPart) -> EvaluationPart:
        return replace(part, tasks=part.tasks.loaded(dataset))

    paths = make_parts(evaluate_part, parts, workers, "tasks judged", PART, load, ROBOT)
    table = pa.concat_tables([read_table(path) for path in paths]).combine_chunks()
    write_atomically(out, table_bytes(table))
    shutil.rmtree(folder)
    return out


def _are_there(path: Path, facts: Mapping[str, Mapping[str, Any]], tasks: Sequence[int]) -> bool:
    """Whether a file has rows of just these methods and tasks that say the same of their making."""
    if not path.exists():
        return False
    table = read_table(path)
    keys = [key for key in SCHEMA.names if key in next(iter(facts.values()))]
    if not {*keys, "task"} <= set(table.column_names):
        return False
    wanted = pa.Table.from_pylist([dict(made) for made in facts.values()], SCHEMA).select(keys).to_pylist()
    there = table.group_by(keys).aggregate([]).select(keys).to_pylist()
    same_tasks = set(table["task"].unique().to_pylist()) == set(tasks)
    return same_tasks and sorted(there, key=str) == sorted(wanted, key=str)
