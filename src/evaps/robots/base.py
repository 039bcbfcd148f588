"""What a robot is, where it is put, where it stands, and when two outcomes are the same."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from evaps.domain import CHOSEN
from evaps.dsl import UserError
from evaps.robots.frames import Observation

HEADING_TOLERANCE = 0.5  # degrees


class SceneError(UserError):
    """A scene that no robot can be put into; the message says why, in one line."""


class EngineError(RuntimeError):
    """The simulator cannot be started or has died; the message says what to do, in one line."""


@dataclass(frozen=True)
class Thing:
    """Something in the world: its kind and its place, in units of the world."""

    kind: str
    x: float
    y: float


@dataclass(frozen=True)
class Pose:
    """Where the robot stands, in units of the world, and looks, in degrees counter-clockwise from east."""

    x: float
    y: float
    heading: float


@dataclass(frozen=True)
class Scene:
    """A start of the world: the robot's pose and the things around it."""

    robot: Pose
    things: tuple[Thing, ...] = ()

    @classmethod
    def from_json(cls, value: Any) -> Scene:
        """Read ``{"robot": {"x", "y", "heading"}, "things": [{"kind", "x", "y"}, ...]}``.

        Raises:
            SceneError: a key is missing or unknown, or a value is not a number.
        """
        _check_keys(value, {"robot", "things"}, "a scene")
        _check_keys(value["robot"], {"x", "y", "heading"}, "robot")
        robot = Pose(*(_number(value["robot"], key, "robot") for key in ("x", "y", "heading")))
        if not isinstance(value["things"], list):
            raise SceneError("things: expected a list")
        return cls(robot, tuple(_thing(item, f"things[{i}]") for i, item in enumerate(value["things"])))

    def to_json(self) -> dict[str, Any]:
        """The inverse of `from_json`."""
        return {
            "robot": {"x": self.robot.x, "y": self.robot.y, "heading": self.robot.heading},
            "things": [{"kind": t.kind, "x": t.x, "y": t.y} for t in self.things],
        }


def _check_keys(value: Any, keys: set[str], where: str) -> None:
    if not isinstance(value, Mapping):
        raise SceneError(f"{where}: expected an object with the keys {', '.join(sorted(keys))}")
    if missing := keys - set(value):
        raise SceneError(f"{where}: the key {sorted(missing)[0]!r} is missing")
    if unknown := set(value) - keys:
        raise SceneError(f"{where}: unknown key {sorted(unknown)[0]!r}; known are {', '.join(sorted(keys))}")


def _number(value: Mapping[str, Any], key: str, where: str) -> int:
    number = value[key]
    if isinstance(number, bool) or not isinstance(number, int | float) or number != number // 1:
        raise SceneError(f"{where}.{key}: expected a whole number, found {number!r}")
    return int(number)


def _thing(value: Any, where: str) -> Thing:
    _check_keys(value, {"kind", "x", "y"}, where)
    if not isinstance(value["kind"], str):
        raise SceneError(f"{where}.kind: expected a name, found {value['kind']!r}")
    return Thing(value["kind"], _number(value, "x", where), _number(value, "y", where))


@dataclass(frozen=True)
class ThingState:
    """A thing as it is now."""

    kind: str
    alive: bool
    x: float
    y: float


@dataclass(frozen=True)
class WorldState:
    """The hidden state of the world, for evaluation alone: no method may read it."""

    robot: Pose
    ammo: int
    health: int
    things: tuple[ThingState, ...]

    def to_json(self) -> dict[str, Any]:
        """``{"x", "y", "heading", "ammo", "health", "things": [{"kind", "alive", "x", "y"}]}``."""
        return {
            "x": self.robot.x,
            "y": self.robot.y,
            "heading": self.robot.heading,
            "ammo": self.ammo,
            "health": self.health,
            "things": [vars(t) for t in self.things],
        }

    @classmethod
    def from_json(cls, value: Mapping[str, Any]) -> WorldState:
        """The inverse of `to_json`."""
        things = tuple(ThingState(t["kind"], t["alive"], t["x"], t["y"]) for t in value["things"])
        return cls(Pose(value["x"], value["y"], value["heading"]), value["ammo"], value["health"], things)


class Robot(ABC):
    """Something that acts in a world and sees only its own view.

    Subclass it to bring your own robot: five methods, and it runs every program whose words it knows.
    """

    @abstractmethod
    def reset(self, scene: Scene) -> None:
        """Put the world back to the start that ``scene`` describes.

        Raises:
            SceneError: the scene is not valid for this robot.
        """

    @abstractmethod
    def act(self, action: str) -> None:
        """Execute one action, until the world is at rest."""

    @abstractmethod
    def perceive(self, perception: str) -> bool:
        """The value of a perception such as ``"ISTHERE Demon"`` in the current view."""

    @abstractmethod
    def observe(self) -> Observation:
        """The current view."""

    @abstractmethod
    def state(self) -> WorldState:
        """The hidden state, for evaluation alone."""

    def fingerprint(self) -> Hashable | None:
        """Equal in two worlds that one scene led to, if from there on nothing can tell them apart.

        A memory then simulates what comes after only once, such as after a step ahead and one to the left,
        in either order. None, the default, says that the robot does not know.
        """
        return None

    @property
    def replaced(self) -> int:
        """How many engines of it have died, or hung, and were replaced; 0 where it has none."""
        return 0

    def close(self) -> None:  # noqa: B027 (most robots hold nothing that must be given back)
        """Give back what the robot holds."""


def state_match(a: WorldState, b: WorldState) -> bool:
    """The headline match: robot, ammunition, health and every thing are the same, within tolerances.

    Robot and things may differ by the domain's tolerance, the heading by `HEADING_TOLERANCE`.
    """
    return (
        _near(a.robot, b.robot)
        and abs((a.robot.heading - b.robot.heading + 180) % 360 - 180) <= HEADING_TOLERANCE
        and (a.ammo, a.health) == (b.ammo, b.health)
        and _same_things(a.things, b.things)
    )


def _near(a: Pose | ThingState, b: Pose | ThingState) -> bool:
    return math.hypot(a.x - b.x, a.y - b.y) <= CHOSEN.tolerance


def _same_things(a: Sequence[ThingState], b: Sequence[ThingState]) -> bool:
    if a == b or len(a) != len(b):
        return a == b
    left = list(b)
    for thing in a:
        same = [t for t in left if (t.kind, t.alive) == (thing.kind, thing.alive) and _near(t, thing)]
        if not same:
            return False
        left.remove(same[0])
    return True
