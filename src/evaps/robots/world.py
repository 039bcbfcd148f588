"""The world of this process's domain: how its robot is made, its scenes, and what is seen of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module

import numpy as np

from evaps.domain import CHOSEN
from evaps.dsl import UserError
from evaps.robots.base import Robot, Scene
from evaps.robots.frames import Image, PaletteFrame

Range = tuple[float, float]


def _any_scene(scene: Scene) -> None:
    """Takes every scene."""


@dataclass(frozen=True)
class World:
    """All that generation, training, evaluation and the pages have to know of a domain's world.

    Attributes:
        version: names the robot and its version, which rises when equal programs may show other frames.
        robot: makes a robot; an engine of its own, if it needs one, starts with the first reset.
        random_scene: draws a scene of a task.
        size: height and width of an observation, in pixels.
        palette: the colours of its `evaps.robots.frames.PaletteFrame`, uint8 ``[256, 3]``.
        validate: raises a `SceneError` for a scene that the robot cannot be put into.
        engine: the package whose version decides what is seen, if there is one.
        x: what a map shows from west to east, in units of the world.
        y: what it shows from south to north.
        radii: for maps: of each kind of thing, and of the ``robot``; who has none is as large as the robot.
        kinds: of things that the studio adds to a scene; all that have a radius, if not given.
        places: where on the map the ``robot`` and ``things`` may be put, ``(x, y)``; all of it if not given.
        headings: degrees between two directions that the robot may look in.
        grid: for maps: the side of a cell, in units of the world; 0 where there are none.
        border: the kind of the thing that ends a scene towards east and north, if there is one: maps shade
            the cells from its own on, and the studio does not take it away.
        blocks: kinds of things that a map shows as squares, twice their radius wide, rather than as circles.
        depth: whether the depth says anything; if not, it is not shown.
        start: the scene that the studio begins with; a random one if not given.
    """

    version: str
    robot: Callable[[], Robot]
    random_scene: Callable[[np.random.Generator], Scene]
    size: tuple[int, int]
    palette: Callable[[], Image]
    validate: Callable[[Scene], None] = _any_scene
    engine: str | None = None
    x: Range = (0, 1)
    y: Range = (0, 1)
    radii: Mapping[str, float] = field(default_factory=lambda: {"robot": 0.5})
    kinds: tuple[str, ...] | None = None
    places: Mapping[str, tuple[Range, Range]] = field(default_factory=dict)
    headings: int = 1
    grid: float = 0
    border: str | None = None
    blocks: tuple[str, ...] = ()
    depth: bool = True
    start: Scene | None = None


@cache
def world() -> World:
    """The world of the domain that this process works in.

    Raises:
        UserError: it cannot be loaded, or does not do.
    """
    module, _, name = CHOSEN.world.partition(":")
    where = f"the world of the domain {CHOSEN.name!r}, {CHOSEN.world},"
    try:
        found = getattr(import_module(module), name)
    except Exception as error:  # of another package's code, whatever it raises
        raise UserError(f"{where} cannot be loaded: {type(error).__name__}: {error}") from error
    if not isinstance(found, World):
        raise UserError(f"{where} is no evaps.robots.world.World")
    _check(found, where)
    return found


def _check(found: World, where: str) -> None:
    """Try what every command will need: a random scene, and what the robot sees of it.

    An engine need not be started for it: a world that has one is evaps' own.

    Raises:
        UserError: it does not do; the message says what it should.
    """
    if found.engine is not None:
        return
    try:
        scene = found.random_scene(np.random.default_rng(0))
        found.validate(Scene.from_json(scene.to_json()))
        with closing(found.robot()) as robot:
            robot.reset(scene)
            frame = robot.observe()
    except Exception as error:
        raise UserError(f"{where} fails on a random scene: {type(error).__name__}: {error}") from error
    if not isinstance(frame, PaletteFrame):
        raise UserError(f"{where} has a robot that sees a {type(frame).__name__}, not a PaletteFrame")
    for plane in (frame.indices, frame.depth):
        if plane.shape != found.size or plane.dtype != np.uint8:
            raise UserError(
                f"{where} says that a view is uint8 of {found.size}, and it is {plane.dtype} of {plane.shape}"
            )
    if not (frame.rgb.any(-1) | (frame.depth > 0)).all():
        raise UserError(f"{where} shows black pixels at depth 0, which stand for those that noise takes away")
