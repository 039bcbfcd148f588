"""Batches that depend on nothing but (seed, step), so that training can be stopped and go on anywhere."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

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
