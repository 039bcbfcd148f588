"""The models: observations embedded, programs learned from, and how long a user waits."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import torch

from evaps.bench.tasks import specification
from evaps.bench.timing import SEED, Figure, best_of, seconds_of
from evaps.dsl import VOCAB, Program
from evaps.dsl.mutation import mutate
from evaps.dsl.sampler import PERCEPTION_KEYS, sample_program
from evaps.models import METHODS, Model, new_method
from evaps.models.base import Execution, Repairer, Synthesizer
from evaps.models.compute import autocast, device
from evaps.robots.doom import DoomRobot
from evaps.robots.memo import MemoRobot
from evaps.synthesis import SPARES, solve
from evaps.synthesis.features import embed
from evaps.tasks.generate import Draft
from evaps.tasks.task import EXAMPLES

BATCH = 64
ROWS = 2000  # of the table of embeddings


def feature_figures(model: Model, drafts: Sequence[Draft]) -> Iterator[Figure]:
    """Observations embedded a second."""
    frames = [frame for draft in drafts for frame in (*draft.first, *draft.last)][:128]
    (spent,) = best_of(lambda: embed(model.encoder, frames))
    yield Figure("observations embedded", len(frames) / spent, "1/s")


def synthesis_figures(robot: DoomRobot, model: Model, drafts: Sequence[Draft], name: str) -> Iterator[Figure]:
    """How long a user waits for an answer, on one thread as in ``evaps synthesize``."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    spares = [DoomRobot() for _ in range(SPARES)]
    times = []
    for draft in drafts:
        memo = MemoRobot(robot, PERCEPTION_KEYS, spares=spares)
        task = specification(draft)
        times.append(seconds_of(lambda task=task, memo=memo: solve(model, task, memo)))  # type: ignore[misc]
        memo.leave()
    for spare in spares:
        spare.close()
    torch.set_num_threads(threads)
    yield Figure(f"{name}, median", float(np.median(times)), "s")
    yield Figure(f"{name}, 95th percentile", float(np.percentile(times, 95)), "s")


def training_figures(seconds: float) -> Iterator[Figure]:
    """Programs that each method learns from in a second."""
    rng = np.random.default_rng(SEED)
    programs = [sample_program(rng) for _ in range(BATCH)]
    for name in METHODS:
        method = new_method(name).to(device()).train()
        loss = _loss(method, programs, rng)
        optimizer = torch.optim.Adam(method.parameters())
        _step(loss, optimizer)  # wakes everything
        steps, start = 0, time.perf_counter()
        while time.perf_counter() - start < seconds:
            _step(loss, optimizer)
            steps += 1
        yield Figure(f"training {name}", BATCH * steps / (time.perf_counter() - start), "programs/s")


def _step(loss: Callable[[], torch.Tensor], optimizer: torch.optim.Optimizer) -> None:
    optimizer.zero_grad()
    with autocast():
        value = loss()
    value.backward()
    optimizer.step()


def _loss(
    method: Synthesizer | Repairer, programs: Sequence[Program], rng: np.random.Generator
) -> Callable[[], torch.Tensor]:
    from evaps.train.synthesizers import collate, lesson

    table = torch.randn(ROWS, 256)
    if isinstance(method, Synthesizer):
        lessons = [lesson(VOCAB.encode(program.tokens)) for program in programs]
        features = table[: 2 * EXAMPLES * len(programs)].unflatten(0, (len(programs), EXAMPLES, 2))
        inputs = features.to(device()), *collate(lessons)
        return lambda: method.loss(*inputs)
    wrong = [_execution(mutate(program, rng), rng) for program in programs]
    return lambda: method.loss(wrong, programs, table.to(device()))


def _execution(program: Program, rng: np.random.Generator) -> Execution:
    seen = [rng.integers(0, ROWS, (EXAMPLES, len(program.segments))) for _ in range(2)]
    return Execution(program, *seen, *(rng.integers(0, ROWS, EXAMPLES) for _ in range(3)))
