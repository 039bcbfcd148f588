"""The Doom robot as a Gymnasium environment, for whoever wants to learn or plan in its world."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from evaps.domain import DOOM
from evaps.robots.base import Scene, SceneError
from evaps.robots.doom import TICS, DoomRobot
from evaps.robots.engine import HEIGHT, WIDTH
from evaps.robots.frames import Image
from evaps.robots.scenes import random_scene

ACTIONS = tuple(TICS)
"""The name of each action, by its number."""
PERCEPTIONS = tuple(f"{name} {thing}" for name in sorted(DOOM.perceptions) for thing in sorted(DOOM.things))


class DoomEnv(gymnasium.Env[dict[str, Any], Any]):
    """The world in which programs run, one action of the language a step.

    ## Description
    A robot with a pistol in a rectangular room, 640 by 448 map units, with up to three each of Demon,
    HellKnight, Revenant and Clip. Monsters stand still and die of one bullet; a Clip is picked up by walking
    over it. The world is deterministic: from one scene, one sequence of actions always gives the same bytes.

    ## Action Space
    ``Discrete(7)``. Every action ends with the world at rest.

    | number | action | what it does |
    |---|---|---|
    | 0 | ``MOVE_FORWARD`` | one step ahead: 5 tics of 1/35 s, then 45 of rest |
    | 1 | ``MOVE_BACKWARD`` | one step back |
    | 2 | ``MOVE_LEFT`` | one step to the left, without turning |
    | 3 | ``MOVE_RIGHT`` | one step to the right, without turning |
    | 4 | ``TURN_LEFT`` | 8.79 degrees counter-clockwise: 5 tics, then 5 of rest |
    | 5 | ``TURN_RIGHT`` | 8.79 degrees clockwise |
    | 6 | ``ATTACK`` | one bullet straight ahead: 1 tic, then 80 of rest |

    ## Observation Space
    ``Dict`` of ``rgb``, uint8 ``[120, 160, 3]``, and ``depth``, uint8 ``[120, 160]`` (about 14 levels per
    100 map units; larger is further away).

    ## Rewards
    Always 0.0. What is to be done here is what an unknown program does, and a task shows that by examples;
    the world itself has no goal. Wrap the environment in a `gymnasium.Wrapper` to give it one of your own.

    ## Starting State
    A random valid scene, drawn from the environment's own generator, or the one in the options of `reset`.

    ## Episode Termination
    Never by itself: the robot cannot die. Pass ``max_episode_steps`` to `gymnasium.make` to cut episodes off
    (programs may take 20 actions).

    ## Information
    ``info["perceptions"]`` has the value of each of the robot's six detectors in the current view, such as
    ``"ISTHERE Demon"`` (a living one has a visible pixel) and ``"INTARGET Demon"`` (the box around a visible
    living one contains the centre of the view). Poses are hidden, as they are from a robot.

    ## Arguments
    ``render_mode``: None or ``"rgb_array"``, the colours of the current view.

    Options of `reset`: ``{"scene": scene}``, a `Scene` or the same as a JSON object; whole map units, whole
    degrees counter-clockwise from east.

    >>> import evaps, gymnasium
    >>> env = gymnasium.make("evaps/Doom-v0", max_episode_steps=20)
    >>> demon = {"kind": "Demon", "x": -100, "y": 300}
    >>> scene = {"robot": {"x": -300, "y": 280, "heading": 0}, "things": [demon]}
    >>> observation, info = env.reset(options={"scene": scene})

    ## Version History
    * v0: first version.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 4}  # noqa: RUF012 - as in every Gymnasium environment

    def __init__(self, render_mode: str | None = None) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode must be None or 'rgb_array', not {render_mode!r}")
        self.render_mode = render_mode
        self.action_space = spaces.Discrete(len(ACTIONS))
        planes = {"rgb": (HEIGHT, WIDTH, 3), "depth": (HEIGHT, WIDTH)}
        self.observation_space = spaces.Dict({k: spaces.Box(0, 255, s, np.uint8) for k, s in planes.items()})
        self._robot = DoomRobot()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Image], dict[str, Any]]:
        """Start an episode.

        Args:
            seed: of the random scenes from now on; None goes on with the generator as it is.
            options: ``{"scene": ...}`` for a scene of your own.

        Raises:
            SceneError: the scene is not valid; or there is an unknown option.
            EngineError: the engine cannot be started.
        """
        super().reset(seed=seed)
        self._robot.reset(self._scene(options or {}))
        return self._observation(), self._info()

    def step(self, action: Any) -> tuple[dict[str, Image], float, bool, bool, dict[str, Any]]:
        """Execute one action, until the world is at rest.

        Raises:
            ValueError: the action is not in the action space.
            EngineError: there was no `reset` before, or the engine has died.
        """
        if not self.action_space.contains(action):
            raise ValueError(f"an action must be a whole number from 0 to {len(ACTIONS) - 1}, not {action!r}")
        self._robot.act(ACTIONS[action])
        return self._observation(), 0.0, False, False, self._info()

    def render(self) -> Image | None:  # type: ignore[override]
        """The colours of the current view, uint8 ``[120, 160, 3]``; None without a render mode."""
        return None if self.render_mode is None else self._robot.observe().rgb.copy()

    def close(self) -> None:
        """End the engine's process."""
        self._robot.close()

    def _scene(self, options: Mapping[str, Any]) -> Scene:
        if unknown := set(options) - {"scene"}:
            raise SceneError(f"reset: unknown option {sorted(unknown)[0]!r}; known is 'scene'")
        scene = options.get("scene")
        if scene is None:
            return random_scene(self.np_random)
        return scene if isinstance(scene, Scene) else Scene.from_json(scene)

    def _observation(self) -> dict[str, Image]:
        view = self._robot.observe()
        return {"rgb": view.rgb.copy(), "depth": view.depth.copy()}

    def _info(self) -> dict[str, Any]:
        return {"perceptions": {key: self._robot.perceive(key) for key in PERCEPTIONS}}
