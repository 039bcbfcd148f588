"""Frames: what makes two equal, and how many of them are kept."""

import numpy as np
import pytest

from evaps.robots.frames import (
    FrameStore,
    Observation,
    PackedFrame,
    PaletteFrame,
    RgbFrame,
    digest,
    frame_match,
)

RNG = np.random.default_rng(0)
PALETTE = RNG.integers(0, 256, (256, 3), np.uint8)
PALETTE[7] = PALETTE[3]  # two names for one colour
BYTES = 2 * 12 * 16


def frame() -> PaletteFrame:
    indices, depth = RNG.integers(0, 256, (2, 12, 16), np.uint8)
    return PaletteFrame(indices, depth, PALETTE)


class Own:
    """An observation of somebody's own."""

    def __init__(self, other: Observation) -> None:
        self.rgb, self.depth = other.rgb, other.depth


def test_equal_looks_have_equal_digests_however_they_are_held() -> None:
    one = frame()
    for other in (RgbFrame(one.rgb, one.depth), Own(one), PackedFrame.of(one).unpack()):
        assert frame_match(one, other)
        assert digest(other) == digest(one)
    assert len(digest(one)) == 16


def test_two_names_for_one_colour_look_the_same() -> None:
    one = frame()
    indices = np.where(one.indices == 3, np.uint8(7), one.indices)
    indices[0, 0], one.indices[0, 0] = 3, 7
    assert frame_match(one, PaletteFrame(indices, one.depth, PALETTE))


@pytest.mark.parametrize("plane", ["rgb", "depth"])
def test_one_other_pixel_is_another_look(plane: str) -> None:
    one = frame()
    planes = {"rgb": one.rgb.copy(), "depth": one.depth.copy()}
    planes[plane][3, 4] ^= 1
    assert not frame_match(one, RgbFrame(**planes))


def test_what_is_packed_is_unpacked() -> None:
    palette = frame()
    unpacked = PackedFrame.of(palette).unpack()
    assert isinstance(unpacked, PaletteFrame)
    assert np.array_equal(unpacked.indices, palette.indices)
    colours = RgbFrame(palette.rgb, palette.depth)
    again = PackedFrame.of(colours).unpack()
    assert isinstance(again, RgbFrame)
    assert np.array_equal(again.rgb, colours.rgb)
    assert np.array_equal(again.depth, colours.depth)


def test_a_store_keeps_the_latest_within_its_budget() -> None:
    store = FrameStore(budget=8 * BYTES)
    frames = [frame() for _ in range(20)]
    for number, one in enumerate(frames):
        store.put(digest(one), one)
        store.put(digest(one), one)
        assert store.size <= 8 * BYTES
        for there in frames[max(0, number - 1) : number + 1]:
            found = store.get(digest(there))
            assert found is not None
            assert frame_match(found, there)
    kept = [one for one in frames if store.get(digest(one))]
    assert frames[-1] in kept
    assert frames[0] not in kept
    assert 4 <= len(kept) <= 9
    store.clear()
    assert (store.size, store.get(digest(frames[-1]))) == (0, None)


def test_looking_at_colours_takes_no_memory() -> None:
    store = FrameStore(budget=100 * BYTES)
    for _ in range(5):
        one = frame()
        store.put(digest(one), one)
        assert one.rgb.shape == (12, 16, 3)
    held = [value for one in store._plain.values() for value in vars(one).values() if value is not PALETTE]
    assert sum(value.nbytes for value in held if isinstance(value, np.ndarray)) == store.size


def test_what_is_put_once_more_was_used() -> None:
    store = FrameStore(budget=12 * BYTES)
    frames = [frame() for _ in range(20)]
    for one in frames:
        store.put(digest(one), one)
        store.put(digest(frames[0]), frames[0])
    assert store.get(digest(frames[0])) is not None
    assert store.get(digest(frames[1])) is None


def test_what_is_used_stays() -> None:
    store = FrameStore(budget=12 * BYTES)
    frames = [frame() for _ in range(20)]
    for one in frames:
        store.put(digest(one), one)
        store.get(digest(frames[0]))
    assert store.get(digest(frames[0])) is not None
    assert store.get(digest(frames[1])) is None
