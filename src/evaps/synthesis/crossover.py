"""Crossovers: of two programs that pass different examples one that asks which of the two it should be.

What both begin with stays. Behind it there has to be a perception that tells the examples apart: where it
holds the one passes, and where it does not the other. So a crossover passes all examples, and costs no
action, since the robot has run both programs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import takewhile

from evaps.dsl import Program, run
from evaps.dsl.nodes import Body, If, IfElse, Not
from evaps.dsl.sampler import MAX_TOKENS, PERCEPTION_KEYS, PERCEPTIONS
from evaps.robots.base import Scene
from evaps.robots.memo import MemoRobot
from evaps.synthesis.solution import Attempt

Seen = frozenset[str]
"""The perceptions that are true somewhere."""


def crossovers(attempts: Sequence[Attempt], scenes: Sequence[Scene], robot: MemoRobot) -> list[Program]:
    """All crossovers of some failed programs, each once.

    Args:
        attempts: programs, and which examples each passes.
        scenes: of the examples.
        robot: has run them.
    """
    failed = [a for a in attempts if not a.solved and any(a.passed)]
    seen_after: dict[Body, list[Seen]] = {}
    found: dict[Program, None] = {}
    for one in failed:
        for other in failed:
            if all(a or b for a, b in zip(one.passed, other.passed, strict=True)):
                for body in _crossed(one, other, scenes, robot, seen_after):
                    found[Program(body)] = None
    return [program for program in found if len(program.tokens) <= MAX_TOKENS]


def _crossed(
    one: Attempt,
    other: Attempt,
    scenes: Sequence[Scene],
    robot: MemoRobot,
    seen_after: dict[Body, list[Seen]],
) -> Iterator[Body]:
    bodies = one.program.body, other.program.body
    alike = len(list(takewhile(lambda pair: pair[0] == pair[1], zip(*bodies, strict=False))))
    for length in range(alike + 1):
        prefix, here, there = bodies[0][:length], bodies[0][length:], bodies[1][length:]
        if prefix not in seen_after:
            seen_after[prefix] = _seen_after(prefix, scenes, robot)
        for perception in PERCEPTIONS:
            holds = [perception.key in seen for seen in seen_after[prefix]]
            passed = (
                a if is_here else b for is_here, a, b in zip(holds, one.passed, other.passed, strict=True)
            )
            if not all(passed):
                continue
            if here and there:
                yield (*prefix, IfElse(perception, here, there))
            elif here:
                yield (*prefix, If(perception, here))
            elif there:
                yield (*prefix, If(Not(perception), there))


def _seen_after(prefix: Body, scenes: Sequence[Scene], robot: MemoRobot) -> list[Seen]:
    """What is perceived in each scene after some statements."""
    found = []
    for scene in scenes:
        robot.reset(scene)
        if prefix:
            run(Program(prefix), robot)
        found.append(frozenset(key for key in PERCEPTION_KEYS if robot.perceive(key)))
    return found
