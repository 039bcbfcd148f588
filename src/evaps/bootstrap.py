"""Means over tasks and seeds with 95 % intervals: a bootstrap of both."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

DRAWS = 10_000
MARGIN = 0.1  # points: by so much the bounds of 1,000 tasks move from one seed of the draws to another
DRAWN_TOGETHER = 1 << 20  # tasks, so that a bootstrap of any number of them takes a few megabytes


class Interval(NamedTuple):
    """A mean with its 95 % interval, in points (hundredths of a share)."""

    mean: float
    low: float
    high: float

    @property
    def certain(self) -> bool:
        """Whether the interval leaves the sign no doubt, and would do so with other draws."""
        return self.low > MARGIN or self.high < -MARGIN

    def __str__(self) -> str:
        return f"{self.mean:+.1f} [{self.low:+.1f}, {self.high:+.1f}]"


def bootstrap(values: Float[np.ndarray, "seed task"], seed: int = 0, draws: int = DRAWS) -> Interval:
    """The mean over seeds and tasks, and its percentile interval; see `bootstraps`.

    Args:
        values: one number for each seed and task.
        seed: of the draws.
        draws: how many.
    """
    return bootstraps(values[None], seed, draws)[0]


def bootstraps(
    values: Float[np.ndarray, "item seed task"], seed: int = 0, draws: int = DRAWS
) -> list[Interval]:
    """The mean of each item over seeds and tasks, and its percentile interval, all of the same draws.

    Each draw has as many tasks as there are, with replacement, and one seed less than there are: the mean of
    ``n`` seeds drawn from ``n`` varies by ``(n - 1) / n`` of what it should, which for few seeds is much too
    little, and that of ``n - 1`` as much as it should (Rao and Wu, 1988, of few units in a stratum). With
    one seed an interval is over tasks alone. No draw is better than the best seed, so that an interval is
    too narrow where few seeds differ by more than the choice of tasks does (docs/evaluation.md has figures).

    Args:
        values: for each item one number, in points, for each seed and task.
        seed: of the draws.
        draws: how many.
    """
    items, seeds, tasks = values.shape
    rng = np.random.default_rng(seed)
    by_task = np.ascontiguousarray(values.reshape(items * seeds, tasks).T, np.float32)
    drawn = max(1, seeds - 1)
    means = []
    for counts in _draws(rng, tasks, draws):
        by_seed = (counts @ by_task / tasks).reshape(-1, items, seeds)
        chosen = rng.integers(0, seeds, (len(counts), 1, drawn))
        means.append(np.take_along_axis(by_seed, np.repeat(chosen, items, 1), 2).mean(2))
    lows, highs = np.percentile(np.concatenate(means), [2.5, 97.5], axis=0)
    averages = values.mean((1, 2))
    return [Interval(*map(float, ends)) for ends in zip(averages, lows, highs, strict=True)]


def _draws(rng: np.random.Generator, tasks: int, draws: int) -> Iterator[Float[np.ndarray, "draw task"]]:
    """How often each draw has each task, some draws at a time."""
    together = max(1, DRAWN_TOGETHER // tasks)
    for start in range(0, draws, together):
        size = min(together, draws - start)
        picked: Int[np.ndarray, "draw task"] = rng.integers(0, tasks, (size, tasks))
        picked += tasks * np.arange(size)[:, None]
        yield np.bincount(picked.ravel(), minlength=size * tasks).reshape(size, tasks).astype(np.float32)
