"""The world of this process's domain: how its robot is made, its scenes, and what is seen of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module

import numpy as np

from evaps.domain import CHOSEN
from evaps.robots.base import Robot, Scene
from evaps.robots.frames import Image

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
        palette: the colours of its :class:`evaps.robots.frames.PaletteFrame`, uint8 ``[256, 3]``.
        validate: raises a `SceneError` for a scene that the robot cannot be put into.
        engine: the package whose version decides what is seen, if there is one.
        x: what a map shows from west to east, in units of the world.
        y: what it shows from south to north.
        radii: for maps: of each kind of thing, and of the ``robot``.
        places: where on the map the ``robot`` and ``things`` may be put, ``(x, y)``; all of it if not given.
        headings: degrees between two directions that the robot may look in.
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
    places: Mapping[str, tuple[Range, Range]] = field(default_factory=dict)
    headings: int = 1
    start: Scene | None = None


@cache
def world() -> World:
    """The world of the domain that this process works in."""
    module, _, name = CHOSEN.world.partition(":")
    found: World = getattr(import_module(module), name)
    return found
