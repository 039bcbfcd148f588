"""What can be said of a program without running it: the longest run, and how many programs are like it."""

from __future__ import annotations

import math

from evaps.dsl.nodes import Action, IfElse, Repeat, Statement, While
from evaps.dsl.program import Program
from evaps.dsl.sampler import ACTIONS, COUNTS, PERCEPTIONS
from evaps.dsl.vocab import token_type


def longest_run(program: Program) -> float:
    """No run takes more actions than this; infinite where there is a ``WHILE``."""
    return sum(map(_longest, program.body))


def _longest(statement: Statement) -> float:
    if isinstance(statement, Action):
        return 1
    if isinstance(statement, While):
        return math.inf
    body = sum(map(_longest, statement.body))
    if isinstance(statement, Repeat):
        return statement.times * body
    return max(body, sum(map(_longest, statement.orelse))) if isinstance(statement, IfElse) else body


def programs_of_shape(program: Program) -> int:
    """How many programs differ from this one in nothing but their actions, conditions and counts."""
    types = [(token, token_type(token)) for token in program.tokens]
    actions = sum(kind == "action" for _, kind in types)
    conditions = sum(kind == "perception" for _, kind in types)
    counts = sum(token.startswith("R=") for token, _ in types)
    return int(len(ACTIONS) ** actions * (2 * len(PERCEPTIONS)) ** conditions * len(COUNTS) ** counts)
