"""Scenes: which are valid and why others are not, random ones, and JSON."""

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evaps.robots.base import Pose, Scene, SceneError, Thing
from evaps.robots.scenes import CENTRE, random_scene, validate
from evaps.robots.wad import RADII

ROBOT = Pose(-300, 280, 0)
SEEDS = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize(
    ("robot", "message"),
    [
        (Pose(-481, 280, 0), r"the robot: x must be a whole number in \[-480, 96\], not -481"),
        (Pose(97, 280, 0), r"the robot: x must .* not 97"),
        (Pose(-300, 95, 0), r"the robot: y must be a whole number in \[96, 480\], not 95"),
        (Pose(-300, 481, 0), r"the robot: y must .* not 481"),
        (Pose(-300.5, 280, 0), r"the robot: x must .* not -300.5"),
        (Pose(-300, math.nan, 0), r"the robot: y must .* not nan"),
        (Pose(-300, 280, -1), r"heading must be whole degrees in \[0, 359\], not -1"),
        (Pose(-300, 280, 360), r"heading must be whole degrees in \[0, 359\], not 360"),
        (Pose(-300, 280, 0.5), r"heading must be whole degrees in \[0, 359\], not 0.5"),
        (Pose(-300, 280, math.nan), r"heading must be whole degrees in \[0, 359\], not nan"),
    ],
)
def test_a_pose_that_is_not_valid(robot: Pose, message: str) -> None:
    with pytest.raises(SceneError, match=message) as error:
        validate(Scene(robot))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("thing", "message"),
    [
        (Thing("Imp", 0, 280), "unknown kind 'Imp'; known are Demon, HellKnight, Revenant, Clip"),
        (Thing("Demon", -417, 280), r"Demon: x must be a whole number in \[-416, 96\], not -417"),
        (Thing("Clip", 97, 280), r"Clip: x must .* not 97"),
        (Thing("Revenant", 0, 95), r"Revenant: y must be a whole number in \[96, 480\], not 95"),
        (Thing("Revenant", 0, 481), r"Revenant: y must .* not 481"),
        (Thing("Demon", 0.5, 280), r"Demon: x must .* not 0.5"),
        (Thing("Demon", -300, 280), r"the robot at \(-300, 280\) and Demon at \(-300, 280\) overlap"),
    ],
)
def test_a_thing_that_is_not_valid(thing: Thing, message: str) -> None:
    with pytest.raises(SceneError, match=message) as error:
        validate(Scene(ROBOT, (Thing("Clip", 90, 470), thing)))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "robot", [Pose(-480, 96, 0), Pose(96, 480, 359), Pose(-480, 480, 180), Pose(96, 96, 1)]
)
@pytest.mark.parametrize("thing", [Thing("Demon", -416, 288), Thing("Clip", -200, 480)])
def test_the_edges_are_valid(robot: Pose, thing: Thing) -> None:
    validate(Scene(robot, (thing,)))


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize(
    ("kinds", "least"),
    [(("Demon", "Demon"), 65), (("Demon", "Revenant"), 55), (("HellKnight", "Clip"), 49)],
)
def test_pairs_must_be_apart_on_one_axis(kinds: tuple[str, str], least: int, axis: str) -> None:
    def pair(apart: int) -> Scene:
        dx, dy = (apart, least - 1) if axis == "x" else (least - 1, apart)
        return Scene(Pose(-480, 96, 0), (Thing(kinds[0], -100, 200), Thing(kinds[1], -100 + dx, 200 + dy)))

    validate(pair(least))
    with pytest.raises(SceneError, match=f"overlap: .* more than {least - 1} map units apart"):
        validate(pair(least - 1))


@pytest.mark.parametrize(("kind", "least"), [("Demon", 51), ("HellKnight", 45), ("Revenant", 41)])
def test_the_robot_needs_room_too(kind: str, least: int) -> None:
    validate(Scene(ROBOT, (Thing(kind, -300 + least, 280),)))
    with pytest.raises(SceneError, match=f"the robot at .* more than {least - 1} map units apart"):
        validate(Scene(ROBOT, (Thing(kind, -300 + least - 1, 280),)))


@settings(deadline=None, max_examples=200)
@given(SEEDS)
def test_random_scenes_are_valid_and_survive_json(seed: int) -> None:
    scene = random_scene(np.random.default_rng(seed))
    validate(scene)
    assert Scene.from_json(json.loads(json.dumps(scene.to_json()))) == scene
    kinds = [thing.kind for thing in scene.things]
    assert all(kinds.count(kind) <= 3 for kind in RADII)
    towards = math.degrees(math.atan2(CENTRE[1] - scene.robot.y, CENTRE[0] - scene.robot.x))
    assert abs((scene.robot.heading - towards + 180) % 360 - 180) <= 0.5


def test_random_scenes_depend_on_the_generator_alone_and_differ() -> None:
    scenes = [random_scene(np.random.default_rng(seed)) for seed in range(200)]
    assert scenes == [random_scene(np.random.default_rng(seed)) for seed in range(200)]
    assert len(set(scenes)) == 200
    for kind in RADII:
        counts = [[t.kind for t in scene.things].count(kind) for scene in scenes]
        assert set(counts) == {0, 1, 2, 3}
        assert 1.2 < np.mean(counts) < 1.8


JSON: dict[str, Any] = {
    "robot": {"x": -300, "y": 280, "heading": 0},
    "things": [{"kind": "Demon", "x": -100, "y": 300}],
}


def test_json_is_read_and_written() -> None:
    scene = Scene(ROBOT, (Thing("Demon", -100, 300),))
    assert Scene.from_json(JSON) == scene
    assert scene.to_json() == JSON
    floats = json.loads(json.dumps(JSON).replace("-300", "-300.0").replace("280", "2.8e2"))
    assert Scene.from_json(floats) == scene
    assert json.dumps(Scene.from_json(floats).to_json()) == json.dumps(JSON)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (None, "a scene: expected an object with the keys robot, things"),
        ([], "a scene: expected an object"),
        ({}, "a scene: the key 'robot' is missing"),
        ({"robot": JSON["robot"]}, "a scene: the key 'things' is missing"),
        ({**JSON, "colour": 1}, "a scene: unknown key 'colour'; known are robot, things"),
        ({**JSON, "robot": 3}, "robot: expected an object with the keys heading, x, y"),
        ({**JSON, "robot": {"x": 1, "y": 2}}, "robot: the key 'heading' is missing"),
        ({**JSON, "robot": {**JSON["robot"], "z": 0}}, "robot: unknown key 'z'"),
        ({**JSON, "robot": {**JSON["robot"], "x": 0.5}}, "robot.x: expected a whole number, found 0.5"),
        ({**JSON, "robot": {**JSON["robot"], "x": "1"}}, "robot.x: expected a whole number, found '1'"),
        ({**JSON, "robot": {**JSON["robot"], "x": True}}, "robot.x: expected a whole number, found True"),
        ({**JSON, "robot": {**JSON["robot"], "x": None}}, "robot.x: expected a whole number, found None"),
        ({**JSON, "robot": {**JSON["robot"], "y": math.nan}}, "robot.y: expected a whole number, found nan"),
        ({**JSON, "robot": {**JSON["robot"], "y": math.inf}}, "robot.y: expected a whole number, found inf"),
        ({**JSON, "things": {}}, "things: expected a list"),
        ({**JSON, "things": [7]}, r"things\[0\]: expected an object with the keys kind, x, y"),
        (
            {**JSON, "things": [*JSON["things"], {"kind": "Clip", "x": 1}]},
            r"things\[1\]: the key 'y' is missing",
        ),
        ({**JSON, "things": [{"kind": 5, "x": 1, "y": 1}]}, r"things\[0\].kind: expected a name, found 5"),
    ],
)
def test_json_that_is_no_scene(value: Any, message: str) -> None:
    with pytest.raises(SceneError, match=message) as error:
        Scene.from_json(value)
    assert "\n" not in str(error.value)
