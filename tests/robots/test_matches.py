"""When two outcomes are the same: tolerances at their edge, and byte for byte."""

from dataclasses import replace

import numpy as np
import pytest

from evaps.robots.base import Pose, ThingState, WorldState, state_match
from evaps.robots.frames import PaletteFrame, RgbFrame, frame_match

DEMON = ThingState("Demon", True, -100.0, 300.0)
CLIP = ThingState("Clip", True, 0.0, 200.0)
STATE = WorldState(Pose(-300.0, 280.0, 10.0), 50, 100, (CLIP, DEMON))


def matches(a: WorldState, b: WorldState) -> bool:
    """A match, which must not depend on the order of the two."""
    assert state_match(a, b) == state_match(b, a)
    return state_match(a, b)


def with_things(*things: ThingState) -> WorldState:
    return replace(STATE, things=things)


def test_a_state_matches_itself_and_survives_json() -> None:
    assert matches(STATE, STATE)
    assert WorldState.from_json(STATE.to_json()) == STATE


@pytest.mark.parametrize(
    ("dx", "dy", "same"),
    [
        (2.0, 0.0, True),
        (0.0, -2.0, True),
        (2.01, 0.0, False),
        (0.0, -2.01, False),
        (1.4, 1.4, True),
        (1.5, 1.5, False),
    ],
)
def test_places_may_differ_by_two_map_units(dx: float, dy: float, same: bool) -> None:
    moved = replace(STATE, robot=replace(STATE.robot, x=STATE.robot.x + dx, y=STATE.robot.y + dy))
    assert matches(STATE, moved) is same
    shifted = replace(DEMON, x=DEMON.x + dx, y=DEMON.y + dy)
    assert matches(STATE, with_things(CLIP, shifted)) is same


@pytest.mark.parametrize(
    ("a", "b", "same"),
    [
        (10.0, 10.5, True),
        (10.0, 9.5, True),
        (10.0, 10.51, False),
        (10.0, 9.49, False),
        (0.0, 359.5, True),
        (0.25, 359.75, True),
        (0.0, 359.49, False),
        (0.25, 359.74, False),
        (0.0, 360.0, True),
        (0.0, 180.0, False),
        (90.0, 270.0, False),
    ],
)
def test_headings_may_differ_by_half_a_degree_also_across_north(a: float, b: float, same: bool) -> None:
    left, right = (replace(STATE, robot=replace(STATE.robot, heading=h)) for h in (a, b))
    assert matches(left, right) is same


@pytest.mark.parametrize("change", [{"ammo": 49}, {"health": 99}])
def test_ammunition_and_health_must_be_equal(change: dict[str, int]) -> None:
    assert not matches(STATE, replace(STATE, **change))


@pytest.mark.parametrize(
    "things",
    [
        (CLIP, replace(DEMON, alive=False)),
        (CLIP, replace(DEMON, kind="Revenant")),
        (CLIP,),
        (CLIP, DEMON, DEMON),
        (CLIP, CLIP),
        (),
    ],
    ids=["dead", "kind", "fewer", "more", "twice", "none"],
)
def test_things_must_be_the_same(things: tuple[ThingState, ...]) -> None:
    assert not matches(STATE, with_things(*things))


def test_the_order_of_things_does_not_matter() -> None:
    assert matches(STATE, with_things(DEMON, CLIP))


def test_of_two_equal_things_each_needs_a_partner_of_its_own() -> None:
    one, far = replace(DEMON, x=0.0), replace(DEMON, x=100.0)
    assert not matches(with_things(one, one), with_things(one, far))
    assert matches(with_things(far, one), with_things(one, far))


def frame() -> RgbFrame:
    rng = np.random.default_rng(0)
    return RgbFrame(
        rng.integers(0, 256, (12, 16, 3), dtype=np.uint8), rng.integers(0, 256, (12, 16), dtype=np.uint8)
    )


def test_frames_match_if_every_byte_is_equal() -> None:
    a = frame()
    assert frame_match(a, RgbFrame(a.rgb.copy(), a.depth.copy()))
    for plane in ("rgb", "depth"):
        b = RgbFrame(a.rgb.copy(), a.depth.copy())
        getattr(b, plane)[..., -1][-1] ^= 1
        assert not frame_match(a, b)
        assert not frame_match(b, a)


def test_frames_of_another_size_do_not_match() -> None:
    a = frame()
    assert not frame_match(a, RgbFrame(a.rgb[:6], a.depth[:6]))


def test_how_a_frame_is_held_does_not_matter() -> None:
    rng = np.random.default_rng(1)
    palette, indices = rng.integers(0, 256, (256, 3), np.uint8), rng.integers(0, 256, (12, 16), np.uint8)
    held = PaletteFrame(indices, indices, palette)
    assert frame_match(held, RgbFrame(palette[indices], indices))
    assert not frame_match(held, RgbFrame(palette[indices ^ 1], indices))
