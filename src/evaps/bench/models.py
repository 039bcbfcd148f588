"""The models: observations embedded, programs learned from, and how long a user waits."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import torch

from evaps.bench.tasks import specification
from evaps.bench.timing import SEED, Figure, best_of, seconds_of
from evaps.dsl import VOCAB, Program
from evaps.dsl.mutation import mutate
from evaps.dsl.sampler import sample_program
from evaps.models import METHODS, Model, new_method
from evaps.models.base import Execution, Repairer, Synthesizer
from evaps.models.compute import autocast, device
from evaps.models.inferred_trace import STOP
from evaps.robots.doom import DoomRobot
from evaps.synthesis import SPARES, memo_of, solve
from evaps.synthesis.features import embed
from evaps.synthesis.mistakes import Mistakes
from evaps.synthesis.ways import Way, WayTable
from evaps.tasks.generate import Draft
from evaps.tasks.task import EXAMPLES

ROWS = 2000  # of the table of embeddings
BATCHES = 64  # before one comes again, whose programs' graphs and edits are known by then


def feature_figures(model: Model, drafts: Sequence[Draft]) -> Iterator[Figure]:
    """Observations embedded a second."""
    frames = [frame for draft in drafts for frame in (*draft.first, *draft.last)][:128]
    (spent,) = best_of(lambda: embed(model.encoder, frames))
    yield Figure("observations embedded", len(frames) / spent, "1/s")


def synthesis_figures(robot: DoomRobot, model: Model, drafts: Sequence[Draft], name: str) -> Iterator[Figure]:
    """How long a user waits for an answer, on one thread as in ``evaps synthesize``."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    team = [robot, *(DoomRobot() for _ in range(SPARES))]
    times = []
    for draft in drafts:
        memo = memo_of(team)
        task = specification(draft)
        times.append(seconds_of(lambda task=task, memo=memo: solve(model, task, memo)))  # type: ignore[misc]
        memo.leave()
    for spare in team[1:]:
        spare.close()
    torch.set_num_threads(threads)
    yield Figure(f"{name}, median", float(np.median(times)), "s")
    yield Figure(f"{name}, 95th percentile", float(np.percentile(times, 95)), "s")


def training_figures(seconds: float, size: int) -> Iterator[Figure]:
    """Programs that each method learns from in a second, and the share of it spent on making batches."""
    rng = np.random.default_rng(SEED)
    programs = [sample_program(rng) for _ in range(BATCHES * size)]
    for name, kind in METHODS.items():
        if kind.start:
            continue  # from rewards: its seconds are the beam's and the engine's
        method = new_method(name).to(device()).train()
        batch, loss = _training(method, programs, rng, size)
        optimizer = torch.optim.Adam(method.parameters())
        _step(loss, batch(0), optimizer)  # wakes everything
        steps, batches, start = 0, 0.0, time.perf_counter()
        while (spent := time.perf_counter() - start) < seconds:
            begun = time.perf_counter()
            steps += 1
            made = batch(steps)
            batches += time.perf_counter() - begun
            _step(loss, made, optimizer)
        yield Figure(f"training {name}", size * steps / spent, "programs/s")
        yield Figure(f"training {name}, making batches", 100 * batches / spent, "%", "<= 15")


def _step(loss: Callable[[Any], torch.Tensor], batch: Any, optimizer: torch.optim.Optimizer) -> None:
    optimizer.zero_grad()
    with autocast():
        value = loss(batch)
    value.backward()
    optimizer.step()


def _training(
    method: Synthesizer | Repairer, programs: Sequence[Program], rng: np.random.Generator, size: int
) -> tuple[Callable[[int], Any], Callable[[Any], torch.Tensor]]:
    """What makes a step's batch, and what becomes of it: a training's code, on random embeddings."""
    from evaps.train.batches import batch_at, rotating_pairs
    from evaps.train.features import features_of
    from evaps.train.lessons import Lessons
    from evaps.train.repairers import mistake_batch

    rows_at = batch_at([len(program.tokens) for program in programs], size, SEED)
    table = torch.randn(ROWS, 256).to(device())
    if isinstance(method, Repairer):
        wrong = [_execution(mutate(program, rng), rng) for program in programs]
        mistakes = Mistakes(
            [0] * len(wrong), wrong, list(programs), [1] * len(wrong), np.zeros((0, 256), np.float16)
        )
        return (
            lambda step: mistake_batch(method, mistakes, rows_at(step), table),
            lambda batch: method.batch_loss(*batch),
        )
    lessons = Lessons.of([VOCAB.encode(program.tokens) for program in programs])
    ways = WayTable.of([[_way(rng) for _ in range(EXAMPLES)] for _ in programs], table)
    features = rng.standard_normal((len(programs), EXAMPLES + 1, 2, 256), np.float32).astype(np.float16)

    def made(step: int) -> Any:
        rows = rows_at(step).tolist()
        if method.acts:
            return ways.batch(rows, device()), *lessons.batch(rows)
        return features_of(features, rows, rotating_pairs(size, rng)), *lessons.batch(rows)

    return made, lambda batch: method.loss(*batch)


def _way(rng: np.random.Generator) -> Way:
    """Of a usual length."""
    length = int(rng.integers(2, 10))
    actions = rng.integers(0, STOP, length)
    actions[-1] = STOP
    return Way(rng.integers(0, ROWS, length).tolist(), [0] * length, actions.tolist(), 0, True)


def _execution(program: Program, rng: np.random.Generator) -> Execution:
    """In which every segment was run once on each pair."""
    segments = len(program.segments)
    seen = [rng.integers(0, ROWS, (EXAMPLES, segments)) for _ in range(2)]
    ends = [rng.integers(0, ROWS, EXAMPLES) for _ in range(3)]
    pair, segment = np.indices((EXAMPLES, segments)).reshape(2, -1)
    events = np.column_stack([pair, segment, rng.integers(0, ROWS, pair.size)])
    return replace(Execution(program, *seen, *ends), events=events)
