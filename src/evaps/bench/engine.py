"""The engine's own speed, and what our execution adds to it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from evaps.bench.timing import SEED, Figure, best_of
from evaps.dsl.sampler import ACTIONS, PERCEPTION_KEYS
from evaps.robots.doom import TICS, DoomRobot
from evaps.robots.scenes import random_scene

WALKS, LENGTH = 10, 8
FRAMES = 200

Call = tuple[Callable[..., Any], tuple[Any, ...]]
"""A method of the engine, and its arguments."""


def engine_figures(robot: DoomRobot) -> Iterator[Figure]:
    """Tics, frames and scenes a second, and our execution as a ratio to the bare calls that it makes."""
    rng = np.random.default_rng(SEED)
    walks = [(random_scene(rng), [str(a) for a in rng.choice(ACTIONS, LENGTH)]) for _ in range(WALKS)]
    tics = sum(sum(TICS[action]) for _, actions in walks for action in actions)

    def looking() -> None:
        for scene, actions in walks:
            robot.reset(scene)
            for action in actions:
                robot.act(action)
                robot.perceive(PERCEPTION_KEYS[0])
                robot.observe()

    def acting() -> None:
        for scene, actions in walks:
            robot.reset(scene)
            for action in actions:
                robot.act(action)

    def setting_up() -> None:
        for scene, _ in walks:
            robot.reset(scene)

    looking()  # starts the engine
    assert robot._engine is not None
    engine = robot._engine

    looked, acted = _record(robot, looking), _record(robot, acting)

    def bare(calls: list[Call]) -> None:
        engine.call(lambda _: _replay(calls))  # on the engine's core, as ours

    def tics_alone() -> None:
        engine.call(lambda game: game.advance_action(tics, False))

    def frames_alone() -> None:
        engine.call(lambda game: [game.advance_action(1, True) for _ in range(FRAMES)])

    ours, raw, acts, raw_acts, plain, frames, placed = best_of(
        looking, lambda: bare(looked), acting, lambda: bare(acted), tics_alone, frames_alone, setting_up
    )
    count = WALKS * LENGTH
    yield Figure("engine: tics without frames", tics / plain, "1/s")
    yield Figure("engine: frames (a tic each), RGB, depth and labels", FRAMES / frames, "1/s")
    yield Figure("engine: scenes set up", WALKS / placed, "1/s")
    yield Figure("actions, nobody looks", count / (acts - placed), "1/s")
    yield Figure("actions, view and perceptions after each", count / (ours - placed), "1/s")
    yield Figure("execution / bare engine, nobody looks", acts / raw_acts, "x", "<= 1.15")
    yield Figure("execution / bare engine, view and perceptions after each", ours / raw, "x", "<= 1.15")


class _Recorder:
    """Writes down what is called on the engine, and calls it."""

    def __init__(self, game: Any) -> None:
        self.game = game
        self.calls: list[Call] = []

    def __getattr__(self, name: str) -> Callable[..., Any]:
        method = getattr(self.game, name)

        def call(*args: Any) -> Any:
            self.calls.append((method, args))
            return method(*args)

        return call


def _record(robot: DoomRobot, work: Callable[[], object]) -> list[Call]:
    """The calls that some work on the robot makes on the engine."""
    engine = robot._engine
    assert engine is not None
    recorder = engine.game = _Recorder(engine.game)
    work()
    engine.game = recorder.game
    return recorder.calls


def _replay(calls: list[Call]) -> None:
    for method, args in calls:
        method(*args)
