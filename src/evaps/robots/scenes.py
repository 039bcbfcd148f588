"""Scenes of the Doom arena: which are valid, and random ones."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np

from evaps.robots.base import Pose, Scene, SceneError, Thing
from evaps.robots.wad import RADII, ROBOT_RADIUS

ROBOT_X = (-480, 96)  # inclusive, map units
THING_X = (-416, 96)
ANY_Y = (96, 480)
CENTRE = (-192, 288)  # what the robot of a random scene faces
GAP = 4  # map units between two things on at least one axis
MOST_OF_A_KIND = 3


def validate(scene: Scene) -> None:
    """Check that the arena can be put into this scene.

    Raises:
        SceneError: which value is wrong, and what it may be.
    """
    for thing in scene.things:
        if thing.kind not in RADII:
            raise SceneError(f"unknown kind {thing.kind!r}; known are {', '.join(RADII)}")
        _check_place(thing, THING_X, thing.kind)
    _check_place(scene.robot, ROBOT_X, "the robot")
    if not 0 <= scene.robot.heading < 360 or scene.robot.heading % 1:
        raise SceneError(f"the robot's heading must be whole degrees in [0, 359], not {scene.robot.heading}")
    for a, b in combinations([_robot_as_thing(scene.robot), *scene.things], 2):
        if not _apart(a, b):
            raise SceneError(
                f"{a.kind} at ({a.x}, {a.y}) and {b.kind} at ({b.x}, {b.y}) overlap: on the x or the y axis "
                f"they must be more than {_radius(a) + _radius(b) + GAP} map units apart"
            )


def random_scene(rng: np.random.Generator) -> Scene:
    """A valid scene with 0 to 3 things of each kind; the robot faces the middle of the arena."""
    robot = _robot_as_thing(_random_place("", ROBOT_X, rng))
    things = [robot]
    for kind in RADII:
        for _ in range(rng.integers(0, MOST_OF_A_KIND + 1)):
            things += _place_apart(kind, things, rng)
    heading = round(math.degrees(math.atan2(CENTRE[1] - robot.y, CENTRE[0] - robot.x))) % 360
    return Scene(Pose(robot.x, robot.y, heading), tuple(things[1:]))


def _place_apart(kind: str, others: list[Thing], rng: np.random.Generator) -> list[Thing]:
    for _ in range(100):  # a crowded arena may have no room left: then this thing stays away
        thing = _random_place(kind, THING_X, rng)
        if all(_apart(thing, other) for other in others):
            return [thing]
    return []


def _random_place(kind: str, x: tuple[int, int], rng: np.random.Generator) -> Thing:
    return Thing(kind, int(rng.integers(x[0], x[1] + 1)), int(rng.integers(ANY_Y[0], ANY_Y[1] + 1)))


def _robot_as_thing(robot: Pose | Thing) -> Thing:
    return Thing("the robot", robot.x, robot.y)


def _radius(thing: Thing) -> int:
    return RADII.get(thing.kind, ROBOT_RADIUS)


def _apart(a: Thing, b: Thing) -> bool:
    return max(abs(a.x - b.x), abs(a.y - b.y)) > _radius(a) + _radius(b) + GAP


def _check_place(place: Pose | Thing, x: tuple[int, int], name: str) -> None:
    for axis, value, (low, high) in (("x", place.x, x), ("y", place.y, ANY_Y)):
        if not low <= value <= high or value % 1:
            raise SceneError(f"{name}: {axis} must be a whole number in [{low}, {high}], not {value}")
