"""Why a program is wrong, in sentences: where its run parts from the run of the program that was meant."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import TYPE_CHECKING

from evaps.dsl import Program
from evaps.viewer.story import Step, first_lines, steps, telling_example

if TYPE_CHECKING:  # else a page would load torch
    from evaps.synthesis.solution import Attempt

MOST = 2  # conditions, or lines, that a sentence names
CONTROL = re.compile(r"\b(?:if|else|while|for)\b")


@dataclass(frozen=True)
class Explanation:
    """What a program does in one scene, and why it is wrong there.

    Attributes:
        scene: which one, from 0: one where it fails if there is one, and there one that says most.
        sentences: with code between backticks; none if it passes everywhere.
    """

    scene: int
    sentences: tuple[str, ...]


def explain(attempt: Attempt, meant: Attempt, scenes: Sequence[str]) -> Explanation:
    """Compare a program's runs with those of the program that was meant.

    Args:
        attempt: the program on some scenes.
        meant: the program that was meant, on the same ones.
        scenes: what these are called in a sentence, such as ``"example 1"``.
    """
    scene = telling_example(attempt)
    if attempt.solved:
        return Explanation(scene, ())
    own, other = (steps(a.traces[scene]) for a in (attempt, meant))
    found = [
        *_parting(own, other, scenes[scene]),
        *_never(attempt),
        *_lacking(attempt.program, meant.program),
    ]
    if not attempt.traces[scene].halted:
        found.insert(1, "It does not come to an end there.")
    return Explanation(scene, tuple(found))


def _parting(own: Sequence[Step], other: Sequence[Step], scene: str) -> Iterator[str]:
    """Where two runs begin to differ, and what each of them asked at that view."""
    moments = list(zip_longest(own, other))
    parted = [i for i, (mine, theirs) in enumerate(moments) if _action(mine) != _action(theirs)]
    if not parted:
        yield f"In {scene} it does what was meant, and then goes on without an action."
        return
    time = parted[0]
    mine, theirs = moments[time]
    along = f"does what was meant for {time} action{'' if time == 1 else 's'}, then " if time else ""
    yield f"In {scene} it {along}{_goes_on(mine, time)} where the hidden program {_goes_on(theirs, time)}."
    for who, step in (("It", mine), ("The hidden program", theirs)):
        if step and step.checks:
            checks = ", ".join(
                f"`{check.text}` is {str(check.value).lower()}" for check in step.checks[:MOST]
            )
            yield f"{who} asks there: {checks}."


def _action(step: Step | None) -> str | None:
    return step.action if step else None


def _goes_on(step: Step | None, time: int) -> str:
    if step is None or step.action is None:
        return "ends"
    return f"{'goes on' if time else 'begins'} with `{step.action}`"


def _never(attempt: Attempt) -> Iterator[str]:
    """Lines that no scene has reached: nobody could tell whether they are right."""
    reached = {segment for trace in attempt.traces for segment in trace.segment_times}
    lines = sorted(first_lines(attempt.program).items())
    never = [text for segment, text in lines if segment not in reached]
    if never:
        yield f"No scene reaches its {' and '.join(f'`{line}`' for line in never[:MOST])}."


def _lacking(program: Program, meant: Program) -> Iterator[str]:
    """Kinds of control flow that the hidden program has and this one has not."""
    own, other = (CONTROL.findall(p.to_python()) for p in (program, meant))
    if lacking := [f"`{word}`" for word in dict.fromkeys(other) if word not in own]:
        named = " or ".join(filter(None, (", ".join(lacking[:-1]), lacking[-1])))
        yield f"It has no {named}; the hidden program has."
