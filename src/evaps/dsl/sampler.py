"""Random programs: the prior that data sets are drawn from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evaps.domain import CHOSEN
from evaps.dsl.program import (
    Action,
    Condition,
    If,
    IfElse,
    Not,
    Perception,
    Program,
    Repeat,
    Statement,
    While,
)
from evaps.dsl.vocab import VOCAB, token_type

ACTIONS = tuple(token for token in VOCAB.tokens if token_type(token) == "action")
"""All actions, in the order of the vocabulary."""
MAX_TOKENS = 32
"""The longest program of a data set, and of what is proposed or repaired."""
COUNTS = tuple(sorted(n for n in CHOSEN.counts if n > 1))
"""How often a REPEAT repeats that is written here; what repeats less may only be read."""
_THINGS = sorted(CHOSEN.things) or (None,)
PERCEPTIONS = tuple(Perception(name, thing) for name in sorted(CHOSEN.perceptions) for thing in _THINGS)
"""All perceptions, in the order of the vocabulary."""
PERCEPTION_KEYS = tuple(p.key for p in PERCEPTIONS)
_COUNT_WEIGHTS = np.array([1 / n for n in COUNTS]) / sum(1 / n for n in COUNTS)  # short loops are commoner


@dataclass(frozen=True)
class SamplerConfig:
    """How random programs look."""

    max_tokens: int = MAX_TOKENS
    """Longer programs are drawn again."""
    conditionals: tuple[float, ...] = (0.15, 0.6, 0.25)
    """How likely a program has 0, 1, 2 ... conditions (IF, IFELSE or WHILE)."""
    repeat: float = 0.07
    """How likely a statement without a condition is a REPEAT."""
    negated: float = 0.5
    """How likely a condition starts with `not`."""
    more: float = 0.42
    """How likely a block goes on after a statement."""
    same: float = 0.2
    """How likely an action repeats the one before it."""


def sample_program(
    rng: np.random.Generator,
    config: SamplerConfig = SamplerConfig(),
    perceptions: Sequence[Perception] = PERCEPTIONS,
    conditionals: int | None = None,
) -> Program:
    """A random program.

    Args:
        rng: where the randomness comes from.
        config: how programs look.
        perceptions: what conditions may ask; a perception that stands here twice is drawn twice as often.
        conditionals: how many conditions it has; drawn from ``config`` if not given.
    """
    if conditionals is None:
        conditionals = int(rng.choice(len(config.conditionals), p=config.conditionals))
    while True:
        program = Program(_Sampler(rng, config, perceptions).body(conditionals))
        if len(program.tokens) <= config.max_tokens:
            return program


class _Sampler:
    def __init__(
        self, rng: np.random.Generator, config: SamplerConfig, perceptions: Sequence[Perception]
    ) -> None:
        self.rng, self.config, self.perceptions = rng, config, perceptions

    def body(self, conditionals: int, depth: int = 0) -> tuple[Statement, ...]:
        """A block whose conditions, nested ones included, are ``conditionals`` in all."""
        statements: list[Statement] = []
        while True:
            share = int(self.rng.integers(1, conditionals + 1)) if conditionals else 0
            if share and self.chance(0.6):
                statements.append(self.conditional(share - 1, depth))
                conditionals -= share
            elif depth < 2 and self.chance(self.config.repeat):
                inside = share if self.chance(0.3) else 0
                statements.append(
                    Repeat(int(self.rng.choice(COUNTS, p=_COUNT_WEIGHTS)), self.body(inside, depth + 1))
                )
                conditionals -= inside
            else:
                statements.append(self.action(statements))
            if not conditionals and not self.chance(
                self.config.more if depth == 0 else self.config.more * 0.6
            ):
                return tuple(statements)

    def conditional(self, inside: int, depth: int) -> Statement:
        kind = int(self.rng.integers(3))
        if kind == 0:
            return If(self.condition(), self.body(inside, depth + 1))
        if kind == 1:
            return While(self.condition(), self.body(inside, depth + 1))
        left = int(self.rng.integers(0, inside + 1))
        body = orelse = self.body(left, depth + 1)
        while orelse == body:  # no example could tell what such a condition asks
            orelse = self.body(inside - left, depth + 1)
        return IfElse(self.condition(), body, orelse)

    def condition(self) -> Condition:
        perception = self.perceptions[int(self.rng.integers(len(self.perceptions)))]
        return Not(perception) if self.chance(self.config.negated) else perception

    def action(self, before: list[Statement]) -> Action:
        if before and isinstance(before[-1], Action) and self.chance(self.config.same):
            return before[-1]
        return Action(str(self.rng.choice(ACTIONS)))

    def chance(self, p: float) -> bool:
        return bool(self.rng.random() < p)
