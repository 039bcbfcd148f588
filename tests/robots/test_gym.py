"""The Gymnasium environment, on the real engine."""

import warnings
from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import evaps  # noqa: F401 - registers the environment
from evaps.dsl.sampler import ACTIONS as WORDS
from evaps.robots.base import EngineError, Scene, SceneError
from evaps.robots.doom import TICS, DoomRobot
from evaps.robots.gym import ACTIONS

SCENE = {
    "robot": {"x": -300, "y": 280, "heading": 0},
    "things": [{"kind": "Demon", "x": -100, "y": 300}],
}


@pytest.fixture(scope="module")
def env() -> Iterator[gymnasium.Env[Any, Any]]:
    made = gymnasium.make("evaps/Doom-v0", render_mode="rgb_array")
    yield made
    made.close()


def test_it_is_a_proper_environment() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = gymnasium.make("evaps/Doom-v0")
        check_env(made.unwrapped)
        made.close()
        made.close()


def test_actions_are_those_of_the_language() -> None:
    assert tuple(TICS) == ACTIONS
    assert set(ACTIONS) == set(WORDS)


@pytest.mark.parametrize("scene", [SCENE, Scene.from_json(SCENE)], ids=["json", "scene"])
def test_it_shows_what_the_robot_sees(env: gymnasium.Env[Any, Any], scene: Any) -> None:
    robot = DoomRobot()
    robot.reset(Scene.from_json(SCENE))
    observation, info = env.reset(options={"scene": scene})
    for action in ("TURN_LEFT", "ATTACK"):
        assert np.array_equal(observation["rgb"], robot.observe().rgb)
        assert np.array_equal(observation["depth"], robot.observe().depth)
        assert np.array_equal(env.render(), observation["rgb"])  # type: ignore[arg-type]
        assert info == {"perceptions": {key: robot.perceive(key) for key in info["perceptions"]}}
        robot.act(action)
        observation, reward, terminated, truncated, info = env.step(ACTIONS.index(action))
        assert (reward, terminated, truncated) == (0.0, False, False)
    assert not info["perceptions"]["ISTHERE Demon"], "the turn aimed at it, and the bullet met it"
    robot.close()


def test_seeds_decide_on_the_scenes(env: gymnasium.Env[Any, Any]) -> None:
    views = [env.reset(seed=seed)[0]["rgb"] for seed in (1, None, 1, None)]
    assert not np.array_equal(views[0], views[1])
    assert np.array_equal(views[0], views[2])
    assert np.array_equal(views[1], views[3])


def test_what_is_returned_is_the_callers_own(env: gymnasium.Env[Any, Any]) -> None:
    observation, _ = env.reset(options={"scene": SCENE})
    observation["rgb"][:] = 0
    observation["depth"][:] = 0
    assert np.any(env.render())  # type: ignore[arg-type]
    assert np.any(env.reset(options={"scene": SCENE})[0]["depth"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scenes": SCENE}, "unknown option 'scenes'"),
        ({"scene": {"robot": SCENE["robot"]}}, "the key 'things' is missing"),
        ({"scene": {**SCENE, "things": SCENE["things"] * 2}}, "overlap"),  # type: ignore[operator]
    ],
)
def test_a_wrong_option_is_refused(
    env: gymnasium.Env[Any, Any], options: dict[str, Any], message: str
) -> None:
    with pytest.raises(SceneError, match=message):
        env.reset(options=options)


@pytest.mark.parametrize("action", [-1, 7, 1.5, "ATTACK"])
def test_a_wrong_action_is_refused(env: gymnasium.Env[Any, Any], action: Any) -> None:
    env.reset(options={"scene": SCENE})
    with pytest.raises(ValueError, match="from 0 to 6"):
        env.unwrapped.step(action)


def test_it_wants_a_reset_and_a_known_render_mode() -> None:
    made = gymnasium.make("evaps/Doom-v0").unwrapped
    with pytest.raises(EngineError, match="reset"):
        made.step(0)
    with pytest.raises(ValueError, match="render_mode"):
        type(made)(render_mode="ascii")  # type: ignore[call-arg]
