"""Noise: pixels of an observation that are invalid, and what can still be compared then."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from evaps.robots.frames import Observation, RgbFrame, digest, frame_match

REMEMBERED = 512  # noisy views: a goal is compared with the same ones again and again


@dataclass(frozen=True, eq=False)
class NoisyFrame(RgbFrame):
    """An observation some of whose pixels are 0 in every channel.

    Attributes:
        share: of the pixels that were dropped, each independently.
    """

    share: float = 0.0


GOAL, VIEW = 0, 1
"""Salts: a goal and a view of the same have lost different pixels, or equal ones would betray the goal."""


def noisy(observation: Observation, share: float, salt: int = GOAL) -> NoisyFrame:
    """Drop pixels; which ones depends on what is seen and on the salt, and on nothing else.

    Args:
        observation: what is seen.
        share: the probability of each pixel to be dropped, in ``[0, 1]``.
        salt: tells two looks at the same from each other.
    """
    seed = int.from_bytes(digest(observation), "big")
    kept = np.random.default_rng([seed, salt]).random(observation.depth.shape) >= share
    return NoisyFrame(observation.rgb * kept[..., None], observation.depth * kept, share)


def goal_match(view: Observation, goal: Observation) -> bool:
    """The strict match with a goal; of a noisy one, on the pixels that are valid in the goal and in the view.

    As large a share of the view's pixels is dropped as of the goal's, but other ones (`noisy_view`). A
    pixel that is 0 in every channel is invalid.
    """
    if not isinstance(goal, NoisyFrame):
        return frame_match(view, goal)
    seen = noisy_view(view, goal.share)
    valid = _valid(seen) & _valid(goal)
    return bool(
        np.array_equal(seen.rgb[valid], goal.rgb[valid])
        and np.array_equal(seen.depth[valid], goal.depth[valid])
    )


class _View:
    """A view that is told from others by its digest alone, for the memory of `_remembered`."""

    __slots__ = ("key", "view")

    def __init__(self, key: bytes, view: Observation) -> None:
        self.key, self.view = key, view

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _View) and self.key == other.key


def noisy_view(view: Observation, share: float) -> NoisyFrame:
    """What the robot sees of a view through noise: the same each time that it looks."""
    return _remembered(_View(digest(view), view), share)


@lru_cache(maxsize=REMEMBERED)
def _remembered(view: _View, share: float) -> NoisyFrame:
    return noisy(view.view, share, VIEW)


def _valid(frame: NoisyFrame) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    return frame.rgb.any(-1) | (frame.depth > 0)
