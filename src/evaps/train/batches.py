"""Batches that depend on nothing but (seed, step), so that training can be stopped and go on anywhere."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import lru_cache
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from evaps.tasks.task import EXAMPLES
from evaps.train.loop import Share

Batch = TypeVar("Batch")
Rows = npt.NDArray[np.int64]
POOL = 16  # batches that are sorted by length together


def batch_at(lengths: Sequence[int], batch: int, seed: int) -> Callable[[int], Rows]:
    """For each step its rows: all rows once an epoch, in random order, those of like length together.

    Args:
        lengths: of the rows; programs of like length need little padding.
        batch: rows in a batch; the last few rows of an epoch are left out.
        seed: of the order.
    """
    sizes = np.asarray(lengths)
    batch = min(batch, len(sizes))
    steps = len(sizes) // batch

    @lru_cache(maxsize=1)
    def epoch(number: int) -> Rows:
        rng = np.random.default_rng([seed, number])
        order = rng.permutation(len(sizes))[: steps * batch]
        for start in range(0, len(order), POOL * batch):
            pool = order[start : start + POOL * batch]
            order[start : start + POOL * batch] = pool[np.argsort(sizes[pool], kind="stable")]
        return rng.permutation(order.reshape(steps, batch))

    return lambda step: epoch(step // steps)[step % steps]


def rotating_pairs(tasks: int, rng: np.random.Generator) -> Rows:
    """Of each task the pairs to learn from, ``[task, pair]``: any five of its six, in random order.

    Args:
        tasks: how many.
        rng: of the draw.
    """
    every = np.tile(np.arange(EXAMPLES + 1), (tasks, 1))
    return rng.permuted(every, axis=1)[:, :EXAMPLES]


def one_ahead(make: Callable[[int, Share], Batch]) -> Callable[[int, Share], Batch]:
    """The same batches; while the model works on a step's, a thread makes the next one.

    Args:
        make: the batch of a step, or a share of it.
    """
    thread = ThreadPoolExecutor(1)
    ahead: dict[int, Future[Batch]] = {}

    def batch(step: int, share: Share) -> Batch:
        made = ahead.pop(step).result() if step in ahead else make(step, share)
        ahead[step + 1] = thread.submit(make, step + 1, share)
        return made

    return batch
