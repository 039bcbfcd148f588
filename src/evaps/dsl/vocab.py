"""Tokens as numbers, and which may come next; both are read off the grammar."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from evaps.dsl.syntax import TOKEN_FORM, Stack

Mask = NDArray[np.bool_]
"""For every token id, whether it may come next: bool ``[len(VOCAB)]``, read-only."""

PAD = "<pad>"
TOKEN_TYPES = ("pad", "action", "perception", "control", "bracket", "constant")
_KINDS = {
    "ACTION": "action",
    "PERCEPTION": "perception",
    "SENSE": "perception",
    "THING": "constant",
    "COUNT": "constant",
}


def _type_of(terminal: str, word: str) -> str:
    return _KINDS.get(terminal) or ("bracket" if word[-1] in "()" else "control")


class Vocab:
    """The tokens of the token form.

    Id 0 is ``<pad>``. The rest are sorted by type, in the order of `TOKEN_TYPES`, and by name within one: ids
    change only if the language does.

    Attributes:
        tokens: by id.
        ids: id of each token.
        terminals: by id, the grammar's name for the token's kind ("" for ``<pad>``).
    """

    def __init__(self) -> None:
        found = [(_type_of(t, word), word, t) for t, words in TOKEN_FORM.words.items() for word in words]
        found.sort(key=lambda entry: (TOKEN_TYPES.index(entry[0]), entry[1]))
        self.tokens: tuple[str, ...] = (PAD, *(word for _, word, _ in found))
        self.terminals: tuple[str, ...] = ("", *(terminal for _, _, terminal in found))
        self.types: dict[str, str] = {PAD: "pad", **{word: kind for kind, word, _ in found}}
        self.ids: dict[str, int] = {token: i for i, token in enumerate(self.tokens)}

    def __len__(self) -> int:
        return len(self.tokens)

    def encode(self, tokens: Iterable[str]) -> list[int]:
        """The ids of tokens.

        Raises:
            ValueError: a token is not in the vocabulary.
        """
        try:
            return [self.ids[token] for token in tokens]
        except KeyError as error:
            raise ValueError(f"{error.args[0]!r} is not a token of the language") from None

    def decode(self, ids: Iterable[int]) -> list[str]:
        """The tokens with these ids; ``<pad>`` is kept.

        Raises:
            ValueError: an id is not in the vocabulary.
        """
        ids = [int(i) for i in ids]
        if any(not 0 <= i < len(self) for i in ids):
            raise ValueError(f"ids must be from 0 to {len(self) - 1}")
        return [self.tokens[i] for i in ids]


VOCAB = Vocab()


def token_type(token: str) -> str:
    """The type of a token, one of `TOKEN_TYPES`.

    Things and ``R=n`` are constants; ``DEF run IF IFELSE ELSE WHILE REPEAT not`` are control.

    Raises:
        ValueError: the token is not in the vocabulary.
    """
    if token not in VOCAB.types:
        raise ValueError(f"{token!r} is not a token of the language")
    return VOCAB.types[token]


class GrammarState:
    """What the grammar remembers of the first tokens of a program. Immutable; equal states are one object.

    Beam search asks millions of times, so all that a state knows is worked out once: `advance` is a look-up
    in a dictionary, and masks are shared arrays that nobody can write to.

    Attributes:
        stack: the open states of lark's LALR parser.
        allowed: the tokens that may come next; none after the program's last token.
        finished: whether the tokens so far are a whole program.
        shortest: the least number of tokens that completes a program from here.
    """

    __slots__ = ("_next", "_within", "allowed", "finished", "shortest", "stack")

    def __init__(self, stack: Stack) -> None:
        table = TOKEN_FORM.table
        self.stack = stack
        self.allowed = _mask(bool(t) and table.step(stack, t) is not None for t in VOCAB.terminals)
        self.finished = table.step(stack, "$END") is not None
        self.shortest = _shortest(stack)
        self._next: dict[int, GrammarState] = {}
        self._within: dict[int, Mask] = {}

    @staticmethod
    def start() -> GrammarState:
        """The state before the first token."""
        return _state(TOKEN_FORM.table.start)

    def advance(self, token_id: int) -> GrammarState:
        """The state after one more token.

        Raises:
            ValueError: the grammar does not allow the token here.
        """
        after = self._next.get(token_id)
        return self._advance(token_id) if after is None else after

    def _advance(self, token_id: int) -> GrammarState:
        if not 0 <= token_id < len(VOCAB) or not self.allowed[token_id]:
            token = VOCAB.tokens[token_id] if 0 <= token_id < len(VOCAB) else token_id
            raise ValueError(f"the grammar does not allow {token} here")
        stack = TOKEN_FORM.table.step(self.stack, VOCAB.terminals[token_id])
        assert stack is not None
        return self._next.setdefault(int(token_id), _state(stack))

    def allowed_within(self, remaining: int) -> Mask:
        """The tokens after which a program can be completed within ``remaining`` tokens, that one too."""
        mask = self._within.get(remaining)
        if mask is None:
            fits = (ok and self.advance(i).shortest < remaining for i, ok in enumerate(self.allowed))
            mask = self._within.setdefault(remaining, _mask(fits))
        return mask

    def __reduce__(self) -> tuple[object, tuple[Stack]]:
        return _state, (self.stack,)

    def __repr__(self) -> str:
        return f"GrammarState(shortest={self.shortest}, finished={self.finished})"


@cache
def _state(stack: Stack) -> GrammarState:
    return GrammarState(stack)


@cache
def _shortest(stack: Stack) -> int:
    """The least number of tokens from a stack to the end: finish the rules under way, one at a time."""
    if stack == TOKEN_FORM.table.end:
        return 0
    return min(tokens + _shortest(after) for tokens, after in TOKEN_FORM.table.reductions(stack))


def _mask(allowed: Iterable[bool]) -> Mask:
    mask = np.fromiter(allowed, dtype=np.bool_, count=len(VOCAB))
    mask.flags.writeable = False
    return mask
