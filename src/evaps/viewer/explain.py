"""Where the run of a program parts from that of the program that was meant, in sentences."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import TYPE_CHECKING

from evaps.dsl import Program
from evaps.viewer.story import Step, steps, telling_example

if TYPE_CHECKING:  # else a page would load torch
    from evaps.synthesis.solution import Attempt

MOST = 2  # conditions, or lines, that a sentence names
CONTROL = re.compile(r"\b(?:if|else|while|for)\b")


@dataclass(frozen=True)
class Explanation:
    """What a program does in one scene, and how that differs from what was meant.

    Attributes:
        scene: which one, from 0: one where the program fails if there is one, and there one that says most.
        sentences: with code between backticks; none if it passes everywhere.
    """

    scene: int
    sentences: tuple[str, ...]


def explain(attempt: Attempt, meant: Attempt, scenes: Sequence[str]) -> Explanation:
    """Compare a program's runs with those of the program that was meant.

    The first difference between two runs need not be the fault: there are many ways to one end.

    Args:
        attempt: the program on some scenes.
        meant: the program that was meant, on the same ones.
        scenes: what these are called in a sentence, such as ``"example 1"``.
    """
    scene = telling_example(attempt)
    if attempt.solved:
        return Explanation(scene, ())
    found = [
        *_passes(attempt, scenes),
        *_parting(attempt, meant, scene, scenes[scene]),
        *_never(attempt),
        *_lacking(attempt.program, meant.program),
    ]
    return Explanation(scene, tuple(found))


def _passes(attempt: Attempt, scenes: Sequence[str]) -> Iterator[str]:
    if all(attempt.passed[:-1]):
        yield f"It passes everywhere but in {scenes[-1]}."


def _parting(attempt: Attempt, meant: Attempt, scene: int, name: str) -> Iterator[str]:
    """Where two runs begin to differ, and what each of them asked last at that view."""
    own, other = (steps(a.traces[scene]) for a in (attempt, meant))
    endless = not attempt.traces[scene].halted
    moments = list(zip_longest(own, other))
    parted = [i for i, (mine, theirs) in enumerate(moments) if _action(mine) != _action(theirs)]
    if not parted:
        yield f"In {name} it does what was meant, and then goes on without an action, and without an end."
        return
    time = parted[0]
    mine, theirs = moments[time]
    along = f"does what was meant for {time} action{'' if time == 1 else 's'}, then " if time else ""
    own_way = "goes on without an action" if endless and mine is own[-1] else _goes_on(mine, time)
    yield f"In {name} it {along}{own_way} where the hidden program {_goes_on(theirs, time)}."
    for who, step in (("it", mine), ("the hidden program", theirs)):
        if step and step.checks:
            checks = ", ".join(f"`{c.text}` is {str(c.value).lower()}" for c in step.checks[-MOST:])
            yield f"What {who} asks {'last ' if len(step.checks) > MOST else ''}at that view: {checks}."
    if endless:
        yield "Its run does not come to an end."


def _action(step: Step | None) -> str | None:
    return step.action if step else None


def _goes_on(step: Step | None, time: int) -> str:
    if step is None or step.action is None:
        return "ends"
    return f"{'goes on' if time else 'begins'} with `{step.action}`"


def _never(attempt: Attempt) -> Iterator[str]:
    """Lines that no scene has reached: nobody could tell whether they are right."""
    reached = {segment for trace in attempt.traces for segment in trace.segment_times}
    never, known = [], set[int]()
    for number, (segment, text) in enumerate(attempt.program.python_lines, 1):
        if segment not in reached | known:
            never.append(f"line {number}, `{text.strip().removesuffix(':')}`")
        known.add(segment)  # an `else:` goes on with a segment that began before
    if never:
        more = ", among others" if len(never) > MOST else ""
        yield f"No scene reaches {' and '.join(never[:MOST])}{more}."


def _lacking(program: Program, meant: Program) -> Iterator[str]:
    """Kinds of control flow that the hidden program has and this one has not."""
    own, other = (CONTROL.findall(p.to_python()) for p in (program, meant))
    if lacking := [f"`{word}`" for word in dict.fromkeys(other) if word not in own]:
        named = " or ".join(filter(None, (", ".join(lacking[:-1]), lacking[-1])))
        yield f"It has no {named}; the hidden program has."
