"""Karel: what his actions do, what he perceives and sees, and which grids there are."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evaps.domain import KAREL
from evaps.robots.base import Pose, Scene, SceneError, Thing
from evaps.robots.frames import digest
from evaps.robots.karel import PALETTE, KarelRobot, random_scene, validate

CELL = 4  # pixels of a cell where the whole grid is seen

CORNER = Thing("Corner", 9, 9)  # eight by eight cells


def karel(x: int, y: int, heading: int, *things: Thing, window: bool = False) -> KarelRobot:
    robot = KarelRobot(window)
    robot.reset(Scene(Pose(x, y, heading), (CORNER, *things)))
    return robot


def place(robot: KarelRobot) -> tuple[float, float, float]:
    pose = robot.state().robot
    return pose.x, pose.y, pose.heading


@pytest.mark.parametrize(("heading", "x", "y"), [(0, 5, 4), (90, 4, 5), (180, 3, 4), (270, 4, 3)])
def test_a_move_leads_where_he_looks(heading: int, x: int, y: int) -> None:
    robot = karel(4, 4, heading)
    robot.act("move")
    assert place(robot) == (x, y, heading)


def test_nothing_leads_out_of_the_grid_or_through_a_wall() -> None:
    for robot in (karel(8, 4, 0), karel(4, 8, 90), karel(1, 4, 180), karel(4, 4, 0, Thing("Wall", 5, 4))):
        before = place(robot)
        assert not robot.perceive("frontIsClear")
        robot.act("move")
        assert place(robot) == before


def test_turns_are_quarters_and_change_what_is_clear() -> None:
    robot = karel(4, 4, 0, Thing("Wall", 4, 5))
    clear = ("frontIsClear", "leftIsClear", "rightIsClear")
    assert [robot.perceive(key) for key in clear] == [True, False, True]
    robot.act("turnLeft")
    assert [robot.perceive(key) for key in clear] == [False, True, True]
    robot.act("turnRight")
    robot.act("turnRight")
    assert place(robot) == (4, 4, 270)
    assert [robot.perceive(key) for key in clear] == [True, True, True]


def test_markers_are_put_and_picked_and_there_are_never_ten() -> None:
    robot = karel(4, 4, 0)
    robot.act("pickMarker")
    assert robot.perceive("noMarkersPresent")
    for _ in range(12):
        robot.act("putMarker")
    assert len(robot.state().things) == 9
    assert robot.perceive("markersPresent")
    assert not robot.perceive("noMarkersPresent")
    for _ in range(12):
        robot.act("pickMarker")
    assert robot.state().things == ()


def test_what_he_cannot_do_is_no_action() -> None:
    with pytest.raises(KeyError):
        karel(4, 4, 0).act("MOVE_FORWARD")
    with pytest.raises(ValueError, match="no perception 'ISTHERE Demon'"):
        karel(4, 4, 0).perceive("ISTHERE Demon")


def cell(robot: KarelRobot, column: int, row: int, size: int = CELL) -> set[tuple[int, ...]]:
    """The colours in a cell of the view, counted from its lower left corner."""
    rgb = robot.observe().rgb[::-1][row * size : (row + 1) * size, column * size : (column + 1) * size]
    return {tuple(map(int, colour)) for colour in rgb.reshape(-1, 3)}


def colour(index: int) -> tuple[int, ...]:
    return tuple(map(int, PALETTE[index]))


def test_the_whole_grid_is_seen_north_up() -> None:
    robot = karel(2, 3, 90, Thing("Wall", 1, 1), Thing("Marker", 8, 8), Thing("Marker", 8, 8))
    assert cell(robot, 0, 0) == {colour(3)}
    assert cell(robot, 7, 7) == {colour(4 + 2)}
    assert cell(robot, 1, 2) == {colour(2), colour(4)}
    assert cell(robot, 8, 0) == {colour(1)}, "beyond the grid there is nothing"
    upper = robot.observe().rgb[::-1][3 * CELL - 1, CELL]
    assert tuple(upper) == colour(4), "he is the half of his cell that he looks to"


@pytest.mark.parametrize("heading", [0, 90, 180, 270])
def test_a_window_shows_what_lies_ahead_from_behind(heading: int) -> None:
    dx, dy = {0: (1, 0), 90: (0, 1), 180: (-1, 0), 270: (0, -1)}[heading]
    ahead, left = (4 + 2 * dx, 4 + 2 * dy), (4 - dy, 4 + dx)
    robot = karel(4, 4, heading, Thing("Wall", *ahead), Thing("Marker", *left), window=True)
    assert cell(robot, 2, 2, 14) == {colour(3)}
    assert cell(robot, 1, 0, 14) == {colour(5)}
    assert cell(robot, 2, 0, 14) == {colour(2), colour(4)}, "he himself, and his cell"
    behind = karel(4, 4, heading, Thing("Wall", 4 - dx, 4 - dy), window=True)
    assert digest(behind.observe()) == digest(karel(4, 4, heading, window=True).observe())


@pytest.mark.parametrize("window", [False, True])
@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), actions=st.lists(st.sampled_from(KAREL.actions), max_size=20))
def test_his_world_is_deterministic(window: bool, seed: int, actions: list[str]) -> None:
    """The same way leads to the same bytes, and equal fingerprints look the same."""
    scene = random_scene(np.random.default_rng(seed))
    robots = [KarelRobot(window) for _ in range(2)]
    for robot in robots:
        robot.reset(scene)
        for action in actions:
            robot.act(action)
    one, two = robots
    assert digest(one.observe()) == digest(two.observe())
    assert (one.state(), one.fingerprint()) == (two.state(), two.fingerprint())
    assert one.observe().indices.all(), "colour 0 is for pixels that are invalid"


def test_random_scenes_are_valid_and_round_trip() -> None:
    rng = np.random.default_rng(0)
    markers: Counter[int] = Counter()
    for _ in range(50):
        scene = random_scene(rng)
        markers.update(Counter((t.x, t.y) for t in scene.things if t.kind == "Marker").values())
        validate(scene)
        assert Scene.from_json(scene.to_json()) == scene
    assert markers[1] > markers[2] > markers[3] > 0, "one marker in a cell is the rule"


@pytest.mark.parametrize(
    ("robot", "things", "what"),
    [
        (Pose(1, 1, 0), (), "need one Corner"),
        (Pose(1, 1, 0), (Thing("Corner", 8, 9),), "with x and y from 9 to 19"),
        (Pose(9, 1, 0), (CORNER,), r"the robot is at \(9, 1\).*from \(1, 1\) to \(8, 8\)"),
        (Pose(1, 1, 45), (CORNER,), "heading must be 0, 90, 180 or 270, not 45"),
        (Pose(1, 1, 0), (CORNER, Thing("Wall", 1, 1)), r"there is a Wall at \(1, 1\)"),
        (Pose(1, 1, 0), (CORNER, Thing("Wall", 2, 1), Thing("Marker", 2, 1)), r"a Wall at \(2, 1\)"),
        (Pose(1, 1, 0), (CORNER, *[Thing("Marker", 2, 1)] * 10), r"10 markers at \(2, 1\); a cell holds 9"),
        (Pose(1, 1, 0), (CORNER, Thing("Demon", 2, 1)), "unknown kind 'Demon'"),
    ],
)
def test_grids_that_there_are_not(robot: Pose, things: tuple[Thing, ...], what: str) -> None:
    with pytest.raises(SceneError, match=what):
        validate(Scene(robot, things))
