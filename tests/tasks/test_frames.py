"""Frames as they are stored: without loss, small, and as tensors."""

import numpy as np
import pytest
import torch

from evaps.robots.base import Pose, Scene, Thing
from evaps.robots.doom import doom_palette
from evaps.robots.frames import PaletteFrame, RgbFrame, frame_match
from evaps.robots.memo import MemoRobot
from evaps.tasks.frames import pack_frame, rgbd, unpack_frame


def frames(count: int) -> list[PaletteFrame]:
    planes = np.random.default_rng(0).integers(0, 256, (count, 2, 120, 160), np.uint8)
    return [PaletteFrame(indices, depth, doom_palette()) for indices, depth in planes]


def test_what_is_packed_is_unpacked() -> None:
    for frame in frames(3):
        again = unpack_frame(pack_frame(frame))
        assert frame_match(again, frame)
        assert np.array_equal(again.indices, frame.indices)


def test_views_of_the_robot_are_small_and_without_loss(robot: MemoRobot) -> None:
    robot.reset(Scene(Pose(-300, 280, 20), (Thing("Demon", -100, 300), Thing("Clip", 0, 200))))
    view = robot.observe()
    packed = pack_frame(view)
    assert len(packed) < 15_000
    assert frame_match(unpack_frame(packed), view)
    assert pack_frame(unpack_frame(packed)) == packed


def test_only_palette_frames_can_be_packed() -> None:
    frame = frames(1)[0]
    with pytest.raises(ValueError, match="held as palette indices"):
        pack_frame(RgbFrame(frame.rgb, frame.depth))


def test_colours_and_depth_are_one_tensor_of_bytes() -> None:
    several = frames(3)
    tensor = rgbd(several)
    assert (tensor.dtype, tuple(tensor.shape)) == (torch.uint8, (3, 120, 160, 4))
    for plane, frame in zip(tensor.numpy(), several, strict=True):
        assert np.array_equal(plane[..., :3], frame.rgb)
        assert np.array_equal(plane[..., 3], frame.depth)
    assert tuple(rgbd([]).shape) == (0, 120, 160, 4)
