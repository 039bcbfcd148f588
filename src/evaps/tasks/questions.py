"""Programs whose conditions are open: what each asks is chosen by what is seen where it is asked."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np

from evaps.dsl import Program
from evaps.dsl.interpreter import unwrapped
from evaps.dsl.nodes import Body, Condition, If, IfElse, Not, Perception, While
from evaps.dsl.sampler import PERCEPTION_KEYS, PERCEPTIONS
from evaps.robots.memo import MemoRobot, RememberedView

Seen = frozenset[str]
"""The perceptions that are true in a view."""


class Unanswered(LookupError):  # noqa: N818 - nothing is wrong
    """A run has come to a condition that is still open.

    Attributes:
        key: which one.
        seen: what is seen there.
    """

    def __init__(self, key: str, seen: Seen) -> None:
        super().__init__(f"{key} is open")
        self.key, self.seen = key, seen


class Endless(Exception):  # noqa: N818 - nothing is wrong
    """A run has come to a loop that waits for something which is not in its scene."""


class OpenProgram:
    """A program of which the control flow, the actions and every `not` are fixed, and no perception.

    Args:
        program: its perceptions are ignored,
        is_open: unless this is False.

    Attributes:
        answers: what is asked, as far as it is known, by the keys that stand for it.
        asking: the program with these keys in the place of the perceptions, to be run on an `Asker`.
    """

    def __init__(self, program: Program, is_open: bool = True) -> None:
        self._is_open = is_open
        self.answers: dict[str, Perception] = {}
        self._loops: dict[str, bool] = {}
        self._negated: dict[str, bool] = {}
        self.asking = Program(_map_conditions(program.body, self._open))

    def _open(self, condition: Condition, loop: bool) -> Condition:
        key = f"?{len(self._loops)}"
        self._loops[key] = loop
        asks, self._negated[key] = unwrapped(condition)
        if not self._is_open:
            self.answers[key] = next(p for p in PERCEPTIONS if p.key == asks)
        return _replace_perception(condition, Perception(key, None))

    def waits_for(self, key: str) -> str | None:
        """What has to be in the world if a condition, that of a loop, is ever to come out false."""
        loops = self._loops[key] and self._negated[key] and key in self.answers
        return self.answers[key].thing if loops else None

    @property
    def program(self) -> Program | None:
        """The program; None as long as a condition is open."""
        if len(self.answers) < len(self._loops):
            return None

        def fill(condition: Condition, _: bool) -> Condition:
            return _replace_perception(condition, self.answers[unwrapped(condition)[0]])

        return Program(_map_conditions(self.asking.body, fill))

    def answer(self, key: str, views: Sequence[Seen], rng: np.random.Generator) -> bool:
        """Choose what a condition asks, given what was seen where runs came to it; False if nothing will do.

        It has to come out true in some of the views and false in others; that of a loop, which comes out
        false in the end, need only be true in some.
        """
        possible = []
        for perception in PERCEPTIONS:
            values = {(perception.key in view) is not self._negated[key] for view in views}
            if len(values) == 2 or (self._loops[key] and values == {True}):
                possible.append(perception)
        if possible:
            self.answers[key] = possible[int(rng.integers(len(possible)))]
        return bool(possible)


class Asker:
    """A robot on which an open program runs, as far as it is answered.

    Args:
        robot: where it runs.
        program: the open program.
        things: kinds that are in the scene.
    """

    def __init__(self, robot: MemoRobot, program: OpenProgram, things: Collection[str]) -> None:
        self.robot, self.program, self.things = robot, program, things
        self.act = robot.act

    def perceive(self, key: str) -> bool:
        """The answer to what was chosen for this key.

        Raises:
            Unanswered: nothing was chosen for it.
            Endless: the loop that asks can be seen not to end.
        """
        perception = self.program.answers.get(key)
        if perception is None:
            raise Unanswered(key, frozenset(p for p in PERCEPTION_KEYS if self.robot.perceive(p)))
        if (awaited := self.program.waits_for(key)) and awaited not in self.things:
            raise Endless
        return self.robot.perceive(perception.key)

    def observe(self) -> RememberedView:
        """The current view."""
        return self.robot.observe()


def _map_conditions(body: Body, change: Callable[[Condition, bool], Condition]) -> Body:
    """The body with every condition changed, from the first to the last; loops are told from branches."""
    out = []
    for statement in body:
        if isinstance(statement, If | IfElse | While):
            statement = replace(
                statement, condition=change(statement.condition, isinstance(statement, While))
            )
        for block in ("body", "orelse"):
            if inner := getattr(statement, block, None):
                statement = replace(statement, **{block: _map_conditions(inner, change)})  # type: ignore[arg-type]
        out.append(statement)
    return tuple(out)


def _replace_perception(condition: Condition, perception: Perception) -> Condition:
    if isinstance(condition, Not):
        return Not(_replace_perception(condition.condition, perception))
    return perception
