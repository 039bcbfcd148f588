"""The frozen syntax tree of a program. Nodes are equal, and hash equally, if they have the same structure."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

from evaps.domain import CHOSEN


@dataclass(frozen=True)
class Action:
    """A step of the robot, such as ``TURN_LEFT``."""

    name: str


@dataclass(frozen=True)
class Perception:
    """A question to the robot's detectors, such as ``ISTHERE Demon``, or ``frontIsClear`` of no thing."""

    name: str
    thing: str | None = None

    @cached_property
    def key(self) -> str:
        """What a robot is asked: the words of the token form, joined by a space."""
        return self.name if self.thing is None else f"{self.name} {self.thing}"

    @property
    def python(self) -> str:
        """How it is written in the Python form, such as ``is_there(Demon)``."""
        return f"{CHOSEN.spelt(self.name)}({self.thing or ''})"


@dataclass(frozen=True)
class Not:
    """The opposite of a condition."""

    condition: Condition


@dataclass(frozen=True)
class If:
    """Run the body if the condition holds."""

    condition: Condition
    body: Body


@dataclass(frozen=True)
class IfElse:
    """Run the body if the condition holds, and ``orelse`` if it does not."""

    condition: Condition
    body: Body
    orelse: Body


@dataclass(frozen=True)
class While:
    """Run the body again and again as long as the condition holds before it."""

    condition: Condition
    body: Body


@dataclass(frozen=True)
class Repeat:
    """Run the body a fixed number of times."""

    times: int
    body: Body


Condition: TypeAlias = Perception | Not
Statement: TypeAlias = Action | If | IfElse | While | Repeat
Body: TypeAlias = tuple[Statement, ...]
