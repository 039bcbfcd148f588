"""The domain that this process works in: the words of a robot, and where its world is.

Vocabularies, masks and the sizes of networks are read off it when evaps is loaded, so that one process has
one domain. The environment variable EVAPS_DOMAIN names it: ``doom``, the default, another of these, or
one of another package, which names it as an entry point of the group ``evaps.domains``.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib.metadata import entry_points
from typing import NoReturn

VARIABLE = "EVAPS_DOMAIN"


@dataclass(frozen=True)
class Axis:
    """Something that one action adds to and another takes from: the inverse model counts how much is left.

    Attributes:
        onwards: the action that adds; None if none does directly, as where a robot has to turn first.
        back: the action that undoes it, if there is one.
        measured: ``"counted"``, by the actions that were done; ``"ahead"`` or ``"left"``, by how far the
            robot got, as it looked: where a way was blocked, the place says so and the actions would not.
    """

    onwards: str | None
    back: str | None = None
    measured: str = "counted"


@dataclass(frozen=True)
class Domain:
    """What is particular to a robot and its world.

    Attributes:
        name: what EVAPS_DOMAIN calls it.
        actions: words of the token form.
        perceptions: words of the token form.
        world: module and name of its `evaps.robots.world.World`; it is imported when a robot is needed.
        things: what a perception asks about; if there are none, a perception stands alone.
        counts: how often a ``REPEAT`` may repeat.
        python: how words are spelt in the Python form, where that is not in snake case.
        tolerance: how far places may be apart and still match, in units of the world.
        move: how far a move leads, in units of the world.
        budget: how many actions a search may simulate, unless told otherwise; fewer where they cost more.
        opposites: axes of the inverse model; each action has to be on one. Without any, each has its own.
    """

    name: str
    actions: tuple[str, ...]
    perceptions: tuple[str, ...]
    world: str
    things: tuple[str, ...] = ()
    counts: tuple[int, ...] = (2, 3, 4, 5, 6)
    python: Mapping[str, str] = field(default_factory=dict)
    tolerance: float = 0.5
    move: float = 1.0
    budget: int = 20_000
    opposites: tuple[Axis, ...] = ()

    def __post_init__(self) -> None:
        words = [*self.actions, *self.perceptions, *self.things]
        wrong = [word for word in words if not word.isidentifier() or words.count(word) > 1]
        if wrong or not self.actions or not self.perceptions:
            what = f"{wrong[0]!r} is no name, or stands there twice" if wrong else "a list of words is empty"
            raise ValueError(f"the domain {self.name!r} needs actions and perceptions: {what}")
        named = [action for axis in self.axes for action in (axis.onwards, axis.back) if action is not None]
        lost = sorted({*named} ^ {*self.actions}) + [action for action in named if named.count(action) > 1]
        if lost:
            raise ValueError(
                f"the domain {self.name!r}: each action has to be on one axis: {lost[0]!r} is not"
            )

    @property
    def axes(self) -> tuple[Axis, ...]:
        """What the inverse model counts."""
        return self.opposites or tuple(map(Axis, self.actions))

    def spelt(self, word: str) -> str:
        """An action or a perception in the Python form: ``turnLeft`` and ``TURN_LEFT`` are ``turn_left``."""
        return self.python.get(word) or re.sub(r"(?<=[a-z])(?=[A-Z])", "_", word).lower()


DOOM = Domain(
    "doom",
    ("MOVE_FORWARD", "MOVE_BACKWARD", "MOVE_LEFT", "MOVE_RIGHT", "TURN_LEFT", "TURN_RIGHT", "ATTACK"),
    ("ISTHERE", "INTARGET"),
    "evaps.robots.doom:WORLD",
    things=("Demon", "HellKnight", "Revenant"),
    python={"ISTHERE": "is_there", "INTARGET": "in_target"},
    tolerance=2.0,
    budget=3_500,
    move=40.0,  # 39.4 ahead, 41.0 to the side
    opposites=(
        Axis("TURN_LEFT", "TURN_RIGHT"),
        Axis("MOVE_FORWARD", "MOVE_BACKWARD", "ahead"),
        Axis("MOVE_LEFT", "MOVE_RIGHT", "left"),
        Axis("ATTACK"),
    ),
)

KAREL = Domain(
    "karel",
    ("move", "turnLeft", "turnRight", "pickMarker", "putMarker"),
    ("frontIsClear", "leftIsClear", "rightIsClear", "markersPresent", "noMarkersPresent"),
    "evaps.robots.karel:WORLD",
    counts=tuple(range(20)),
    opposites=(
        Axis("turnLeft", "turnRight"),
        Axis("move", None, "ahead"),
        Axis(None, None, "left"),
        Axis("putMarker", "pickMarker"),
    ),
)
"""Karel the Robot (Pattis, 1981) with the tokens of Bunel et al., ICLR 2018, who see the whole grid."""

KAREL_WINDOW = replace(KAREL, name="karel-window", world="evaps.robots.karel:WINDOW_WORLD")
"""The same, but the robot sees only a window ahead."""

DOMAINS = {domain.name: domain for domain in (DOOM, KAREL, KAREL_WINDOW)}
"""Those that come with evaps."""


def domain_called(name: str) -> Domain:
    """A domain of evaps, or of another package.

    Raises:
        SystemExit: there is none: status 2 after one clear line, since nothing can be loaded without it.
    """
    if name in DOMAINS:
        return DOMAINS[name]
    others = {entry.name: entry for entry in entry_points(group="evaps.domains")}
    if name not in others:
        known = ", ".join(sorted({*DOMAINS, *others}))
        _end(f"{VARIABLE} is {name!r}, and there is no such domain; known are {known}")
    where = others[name].value
    try:
        found = others[name].load()
    except Exception as error:
        _end(f"the domain {name!r}, {where}, cannot be loaded: {error}")
    if not isinstance(found, Domain):
        _end(f"the domain {name!r}, {where}, is no evaps.domain.Domain")
    return found


def _end(message: str) -> NoReturn:
    print(f"evaps: {message}", file=sys.stderr)
    raise SystemExit(2)


CHOSEN = domain_called(os.environ.get(VARIABLE) or DOOM.name)
"""The domain of this process."""
