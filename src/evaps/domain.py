"""The domain that this process works in: the words of a robot, and where its world is.

Vocabularies, masks and the sizes of networks are read off it when evaps is loaded, so that one process has
one domain. The environment variable EVAPS_DOMAIN names it: ``doom``, the default, another of these, or
one of another package, which names it as an entry point of the group ``evaps.domains``.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from importlib.metadata import entry_points
from keyword import iskeyword

VARIABLE = "EVAPS_DOMAIN"
RESERVED = {"DEF", "run", "IF", "IFELSE", "ELSE", "WHILE", "REPEAT", "not", "range", "_"}
"""Words of the syntax, which no domain can have; nor those of Python's."""

MEASURED = ("counted", "ahead", "left")
"""How an axis may be measured."""


class DomainError(ValueError):
    """There is no such domain, or it makes no language; the message says why, in one line."""


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
        model: the checkpoints that are used unless others are named: a set that comes with evaps, a folder,
            or ``hub:OWNER/NAME``.
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
    model: str = "small"
    opposites: tuple[Axis, ...] = ()

    def __post_init__(self) -> None:
        if fault := next(self._faults(), None):
            raise DomainError(f"the domain {self.name!r}: {fault}")

    def _faults(self) -> Iterator[str]:
        """What keeps it from being a language that can be read, written and learned."""
        if not self.actions or not self.perceptions:
            yield "it needs actions and perceptions"
        words = [*self.actions, *self.perceptions]
        spelt = [*map(self.spelt, words), *self.things]
        for word, said in zip([*words, *self.things], spelt, strict=True):
            free = not {word, said} & RESERVED and not iskeyword(said)
            if not (free and word.isidentifier() and said.isidentifier()):
                yield f"{word!r} cannot be a word of the language"
            if spelt.count(said) > 1:
                yield f"{word!r} stands there twice"
        if len({*self.counts}) < len(self.counts) or not any(type(n) is int and n > 1 for n in self.counts):
            yield "counts need whole numbers, each once, and one of at least 2"
        if not all(type(n) is int and n >= 0 for n in self.counts):
            yield "counts are whole numbers of at least 0"
        if not re.fullmatch(r"[\w.]+:\w+", self.world):
            yield f"world has to be MODULE:NAME, not {self.world!r}"
        if self.move <= 0 or self.tolerance < 0 or self.budget < 1:
            yield "move and budget have to be more than 0, and tolerance not less"
        yield from self._faults_of_axes()

    def _faults_of_axes(self) -> Iterator[str]:
        named = [action for axis in self.axes for action in (axis.onwards, axis.back) if action is not None]
        for action in named:
            if action not in self.actions:
                yield f"the axis of {action!r} has no such action"
            if named.count(action) > 1:
                yield f"{action!r} is on two axes"
        for action in self.actions:
            if action not in named:
                yield f"{action!r} is on no axis"
        for axis in self.axes:
            if axis.measured not in MEASURED:
                yield f"an axis is measured as one of {', '.join(MEASURED)}, not {axis.measured!r}"

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
    model="karel",
    opposites=(
        Axis("turnLeft", "turnRight"),
        Axis("move", None, "ahead"),
        Axis(None, None, "left"),
        Axis("putMarker", "pickMarker"),
    ),
)
"""Karel the Robot (Pattis, 1981) with the tokens of Bunel et al., ICLR 2018, who see the whole grid."""

KAREL_WINDOW = replace(
    KAREL, name="karel-window", world="evaps.robots.karel:WINDOW_WORLD", model="karel-window"
)
"""The same, but the robot sees only a window ahead."""

DOMAINS = {domain.name: domain for domain in (DOOM, KAREL, KAREL_WINDOW)}
"""Those that come with evaps."""


def domain_called(name: str) -> Domain:
    """A domain of evaps, or of another package.

    Raises:
        DomainError: there is none, or it cannot be loaded.
    """
    if name in DOMAINS:
        return DOMAINS[name]
    others = {entry.name: entry for entry in entry_points(group="evaps.domains")}
    if name not in others:
        known = ", ".join(sorted({*DOMAINS, *others}))
        raise DomainError(f"{VARIABLE} is {name!r}, and there is no such domain; known are {known}")
    where = others[name].value
    try:
        found = others[name].load()
    except Exception as error:
        raise DomainError(f"the domain {name!r}, {where}, cannot be loaded: {error}") from error
    if not isinstance(found, Domain):
        raise DomainError(f"the domain {name!r}, {where}, is no evaps.domain.Domain")
    if found.name != name:
        raise DomainError(f"the domain {name!r}, {where}, calls itself {found.name!r}; name both alike")
    return found


CHOSEN: Domain
"""The domain of this process, read off EVAPS_DOMAIN when it is first asked for."""


def __getattr__(name: str) -> Domain:
    if name != "CHOSEN":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    chosen = globals()["CHOSEN"] = domain_called(os.environ.get(VARIABLE) or DOOM.name)
    return chosen
