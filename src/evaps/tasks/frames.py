"""A robot's frames as data sets store them and as networks see them. No torch, so that workers start soon."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import numpy.typing as npt
import zstandard

from evaps.robots.frames import Observation, PaletteFrame, decompress, words_of
from evaps.robots.world import world

LEVEL = 5  # the twelve frames of a task: 93 KB in 3.7 ms; level 3: 95 KB in 1.8 ms; one by one: 123 KB


@cache
def _compressor() -> zstandard.ZstdCompressor:
    window = zstandard.ZstdCompressionParameters.from_level(LEVEL, window_log=20)  # back to the first frame
    return zstandard.ZstdCompressor(compression_params=window)


def pack_frames(frames: Sequence[Observation]) -> bytes:
    """Frames of the domain's robot, compressed together and without loss.

    What is compressed is an array of bytes ``[2, frame, height, width]``: of each frame its indices into the
    palette, and then of each its depth.

    Raises:
        ValueError: a frame is not held as palette indices.
    """
    planes = np.empty((2, len(frames), *world().size), np.uint8)
    for i, frame in enumerate(frames):
        if not isinstance(frame, PaletteFrame):
            raise ValueError("only frames that are held as palette indices can be packed")
        planes[0, i], planes[1, i] = frame.indices, frame.depth
    return _compressor().compress(planes.tobytes())


def unpack_frames(packed: bytes) -> list[PaletteFrame]:
    """The inverse of `pack_frames`."""
    planes, palette = decompress(packed).reshape(2, -1, *world().size), world().palette()
    return [PaletteFrame(indices, depth, palette) for indices, depth in zip(*planes, strict=True)]


def rgbd(frames: Sequence[PaletteFrame]) -> npt.NDArray[np.uint8]:
    """Colours and depth of frames as one array of bytes ``[frame, height, width, 4]``."""
    out = np.empty((len(frames), *world().size), np.uint32)
    for target, frame in zip(out, frames, strict=True):  # one look-up a pixel instead of one a channel
        np.take(words_of(frame.palette), frame.indices, out=target, mode="clip")
    planes = out.view(np.uint8).reshape(*out.shape, 4)
    for plane, frame in zip(planes, frames, strict=True):
        plane[..., 3] = frame.depth
    return planes
