"""Noise: which pixels are dropped, and when a goal still matches."""

import numpy as np
import pytest

from evaps.robots.base import Pose, Scene
from evaps.robots.frames import RgbFrame, digest
from evaps.robots.noise import NoisyFrame, goal_match, noisy, noisy_view
from evaps.tasks.task import Example, Task


def frame(seed: int) -> RgbFrame:
    rng = np.random.default_rng(seed)
    return RgbFrame(
        rng.integers(1, 256, (120, 160, 3), dtype=np.uint8), rng.integers(1, 256, (120, 160), dtype=np.uint8)
    )


@pytest.mark.parametrize("share", [0.0, 0.05, 0.2])
def test_so_many_pixels_are_dropped_in_every_channel(share: float) -> None:
    seen = noisy(frame(0), share)
    dropped = seen.depth == 0
    assert dropped.mean() == pytest.approx(share, abs=0.01)
    assert not seen.rgb[dropped].any()
    assert np.array_equal(seen.rgb[~dropped], frame(0).rgb[~dropped])
    assert np.array_equal(seen.depth[~dropped], frame(0).depth[~dropped])


def test_the_same_view_is_always_dropped_in_the_same_way() -> None:
    assert digest(noisy(frame(0), 0.1)) == digest(noisy(frame(0), 0.1))
    assert digest(noisy(frame(0), 0.1)) != digest(noisy(frame(0), 0.1, salt=1))
    one, two = (noisy(frame(seed), 0.1).depth == 0 for seed in (0, 1))
    assert (one != two).any()


def test_a_noisy_goal_is_matched_by_what_it_was_made_of_alone() -> None:
    goal = noisy(frame(0), 0.2)
    assert goal_match(frame(0), goal)
    assert not goal_match(frame(1), goal)
    almost = frame(0)
    almost.rgb[60, 80:90, 0] ^= 1  # ten pixels: all of them are invalid once in 100,000 times
    assert not goal_match(RgbFrame(almost.rgb, almost.depth), goal)
    assert not goal_match(RgbFrame(almost.rgb, almost.depth), frame(0))


def test_a_view_has_lost_other_pixels_than_a_goal_that_is_equal() -> None:
    goal, view = noisy(frame(0), 0.2), noisy_view(frame(0), 0.2)
    assert ((goal.depth == 0) != (view.depth == 0)).any()
    assert digest(noisy_view(frame(0), 0.2)) == digest(view)


def test_a_task_seen_through_noise_keeps_its_scenes() -> None:
    task = Task("one", (Example(Scene(Pose(0, 0, 0)), frame(0)),))
    seen = task.with_noise(0.1)
    assert (seen.name, seen.noise, task.noise) == ("one", 0.1, 0.0)
    assert seen.examples[0].scene == task.examples[0].scene
    assert isinstance(seen.examples[0].goal, NoisyFrame)
