"""Programs: frozen trees with a token form, a Python form, segments and a graph of tokens."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from evaps.dsl.layout import Layout
from evaps.dsl.nodes import (
    Action,
    Body,
    Condition,
    If,
    IfElse,
    Not,
    Perception,
    Repeat,
    Statement,
    While,
)
from evaps.dsl.parsing import ProgramError, parse_body
from evaps.dsl.syntax import PYTHON_FORM, TOKEN_FORM
from evaps.dsl.vocab import VOCAB

__all__ = [
    "Action",
    "Body",
    "Condition",
    "If",
    "IfElse",
    "Not",
    "Perception",
    "Program",
    "ProgramError",
    "Repeat",
    "Segment",
    "Statement",
    "While",
]


@dataclass(frozen=True)
class Program:
    """A program, as a tree; equal to every program with the same structure.

    Token form (Sun et al., "Neural Program Synthesis from Diverse Demonstration Videos", 2018):
    ``DEF run m( WHILE c( not c( INTARGET Demon c) c) w( TURN_LEFT w) ATTACK m)``

    Python form, of the same program:

    ```python
    def run():
        while not in_target(Demon):
            turn_left()
        attack()
    ```
    """

    body: Body

    @classmethod
    def parse(cls, text: str) -> Program:
        """The program that a text in either form spells.

        In the token form, white space of any kind stands between tokens. In both, ``#`` begins a comment.

        Raises:
            ProgramError: the text is not a program; it says where, what was found, and what could stand.
        """
        return cls(parse_body(text))

    @classmethod
    def from_tokens(cls, tokens: Sequence[str]) -> Program:
        """The program with these tokens, in the token form.

        Raises:
            ProgramError: as for `parse`, with columns in the tokens joined by single spaces.
        """
        return cls.parse(" ".join(tokens))

    @classmethod
    def from_ids(cls, ids: Iterable[int]) -> Program:
        """The program whose tokens have these numbers in VOCAB.

        Raises:
            ValueError: an id is not in the vocabulary.
            ProgramError: as for `from_tokens`.
        """
        return cls.from_tokens(VOCAB.decode(ids))

    @cached_property
    def _layout(self) -> Layout:
        return Layout.of(self.body, TOKEN_FORM)

    @cached_property
    def tokens(self) -> tuple[str, ...]:
        """The canonical token form.

        Raises:
            ValueError: the tree, built by hand, has an unknown word or an empty block.
        """
        return tuple(self._layout.pieces)

    @cached_property
    def token_ids(self) -> NDArray[np.int64]:
        """The tokens' numbers in VOCAB, int64 ``[token]``."""
        return np.array(VOCAB.encode(self.tokens), np.int64)

    def __str__(self) -> str:
        return " ".join(self.tokens)

    @cached_property
    def python_lines(self) -> tuple[tuple[int, str], ...]:
        """For every line of the Python form, the index of the segment that it shows, and its text."""
        return tuple(Layout.of(self.body, PYTHON_FORM).lines())

    def to_python(self) -> str:
        """The Python form: four spaces an indent, a line end at the end."""
        return "".join(f"{line}\n" for _, line in self.python_lines)

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """The whole program, then every statement in the order in which they begin."""
        layout = self._layout
        each = zip(layout.nodes, layout.parents, layout.spans, strict=True)
        return tuple(Segment(i, node or self, parent, *span) for i, (node, parent, span) in enumerate(each))

    @cached_property
    def token_segments(self) -> tuple[int, ...]:
        """For each token, the index of its innermost segment."""
        return tuple(self._layout.owners)

    @cached_property
    def edges(self) -> tuple[tuple[int, int], ...]:
        """The undirected graph of tokens, each edge once as (i, j) with i < j, sorted.

        A right pointer joins each token to the next one. A left pointer joins ``IF``, ``IFELSE``, ``WHILE``
        or ``REPEAT`` to the head of its condition: the perception's name, the first ``not``, or ``R=n``.
        """
        right = {(i, i + 1) for i in range(len(self.tokens) - 1)}
        heads = zip(self.segments[1:], self._layout.heads[1:], strict=True)
        left = {(segment.start, head) for segment, head in heads if head > segment.start}
        return tuple(sorted(right | left))

    def __reduce__(self) -> tuple[type[Program], tuple[Body]]:
        return Program, (self.body,)  # without what is cached


@dataclass(frozen=True)
class Segment:
    """A part of a program that is executed as a whole: <condition, token, body>, or the program itself.

    Attributes:
        index: its place in `Program.segments`.
        node: the statement, or the program for segment 0.
        parent: the index of the segment around it; None for segment 0.
        start: its first token.
        stop: the token after its last.
    """

    index: int
    node: Program | Statement
    parent: int | None
    start: int
    stop: int
