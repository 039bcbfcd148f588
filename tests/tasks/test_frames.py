"""Frames as they are stored: without loss, small, and as networks see them."""

import numpy as np
import pytest
import zstandard

from evaps.robots.base import Pose, Scene, Thing
from evaps.robots.engine import doom_palette
from evaps.robots.frames import PaletteFrame, RgbFrame, frame_match
from evaps.robots.memo import MemoRobot
from evaps.tasks.frames import pack_frames, rgbd, unpack_frames


def frames(count: int) -> list[PaletteFrame]:
    planes = np.random.default_rng(0).integers(0, 256, (count, 2, 120, 160), np.uint8)
    return [PaletteFrame(indices, depth, doom_palette()) for indices, depth in planes]


def test_what_is_packed_is_unpacked() -> None:
    for several in (frames(3), frames(1), []):
        again = unpack_frames(pack_frames(several))
        assert len(again) == len(several)
        for one, other in zip(again, several, strict=True):
            assert frame_match(one, other)
            assert np.array_equal(one.indices, other.indices)


def test_views_of_the_robot_are_small_and_without_loss(robot: MemoRobot) -> None:
    robot.reset(Scene(Pose(-300, 280, 20), (Thing("Demon", -100, 300), Thing("Clip", 0, 200))))
    views = [robot.observe().frame]
    for action in ("TURN_LEFT", "MOVE_FORWARD", "ATTACK"):
        robot.act(action)
        views.append(robot.observe().frame)
    packed = pack_frames(views)
    assert len(packed) < 4 * 10_000
    assert all(map(frame_match, unpack_frames(packed), views))
    assert pack_frames(unpack_frames(packed)) == packed


def test_only_palette_frames_can_be_packed() -> None:
    frame = frames(1)[0]
    with pytest.raises(ValueError, match="held as palette indices"):
        pack_frames([frame, RgbFrame(frame.rgb, frame.depth)])


def test_a_reader_without_our_code_can_unpack_them() -> None:
    """As docs/data.md shows it."""
    several = frames(3)
    planes = np.frombuffer(zstandard.decompress(pack_frames(several)), np.uint8)
    indices, depth = planes.reshape(2, -1, 120, 160)
    assert np.array_equal(indices, [frame.indices for frame in several])
    assert np.array_equal(depth, [frame.depth for frame in several])


def test_colours_and_depth_are_one_array_of_bytes() -> None:
    several = frames(3)
    planes = rgbd(several)
    assert (planes.dtype, planes.shape) == (np.uint8, (3, 120, 160, 4))
    for plane, frame in zip(planes, several, strict=True):
        assert np.array_equal(plane[..., :3], frame.rgb)
        assert np.array_equal(plane[..., 3], frame.depth)
    assert rgbd([]).shape == (0, 120, 160, 4)
