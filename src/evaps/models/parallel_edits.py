"""Edits of all tokens at once, the literal reading of EVAPS: what to learn, and how to decode them.

Each token is replaced (by itself: kept) or deleted, and behind each up to ``SLOTS`` tokens are inserted. No
edit knows the others; the grammar alone decides which of them can stand together.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Int
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F

from evaps.dsl import VOCAB, GrammarState, Program
from evaps.dsl.alignment import align
from evaps.dsl.sampler import MAX_TOKENS
from evaps.models.base import pad

SLOTS = 8  # the paper inserts nothing or says nothing about it; a whole `IF c( ... c) i(` fits into 8
DELETE = NOTHING = 0  # <pad> is no token of any program, so its id says: no token here
_CLOSING = VOCAB.ids["m)"]  # it ends every program, and stands nowhere else
_PRUNE = 6.0  # options that are e^6 times less likely than the best one are not looked at

Scores = NDArray[np.float32]


def edit_targets(before: Program, after: Program, slots: int = SLOTS) -> tuple[list[int], list[list[int]]]:
    """The edits that turn one program into another, by the shortest alignment.

    Returns:
        for each token its replacement (or DELETE), and for the gap behind each token what to insert there
        (``slots`` ids, NOTHING where there is nothing left to insert).
    """
    replace: list[int] = []
    insert: list[list[int]] = []
    for edit in align(before.tokens, after.tokens):
        if edit.old is None:
            assert edit.new is not None
            insert[-1].append(VOCAB.ids[edit.new])  # a program's first token is always kept
        else:
            replace.append(DELETE if edit.new is None else VOCAB.ids[edit.new])
            insert.append([])
    return replace, [(row + [NOTHING] * slots)[:slots] for row in insert]


@dataclass(frozen=True)
class _Edited:
    """The left part of an edited program."""

    tokens: tuple[int, ...]
    score: float
    grammar: GrammarState
    longest: int

    def allowed_if_substituted(self) -> NDArray[np.bool_]:
        """Which tokens may come next if a program of just the longest length is to come out.

        A program that is not closed yet can be of any length that it can be closed within.
        """
        left = self.longest - len(self.tokens)
        mask = self.grammar.allowed_within(left).copy()
        mask[_CLOSING] &= left == 1
        return mask

    def extended(self, token: int, score: float) -> _Edited | None:
        """With one more token; None if no program starts like that."""
        if not self.grammar.allowed_within(self.longest - len(self.tokens))[token]:
            return None
        return replace(
            self,
            tokens=(*self.tokens, token),
            score=self.score + score,
            grammar=self.grammar.advance(token),
        )

    def scored(self, score: float) -> _Edited:
        return replace(self, score=self.score + score)


def decode_edits(tokens: Scores, insert: Scores, beam: int) -> Iterator[Program]:
    """Edited programs in the order of their probability; each of them parses.

    Args:
        tokens: log-probabilities of each token's replacement ``[token, vocab]``.
        insert: log-probabilities ``[token, slot, vocab]``.
        beam: how many left parts are kept after each token.
    """
    if insert.shape[1]:
        live = _edited(tokens, insert, beam)
    else:
        live = _substituted(tokens, beam)
    for hypothesis in sorted(live, key=lambda h: -h.score):
        if hypothesis.grammar.finished:
            yield Program.from_ids(hypothesis.tokens)


def _edited(tokens: Scores, insert: Scores, beam: int) -> list[_Edited]:
    live = [_Edited((), 0.0, GrammarState.start(), MAX_TOKENS)]
    for token_scores, slot_scores in zip(tokens, insert, strict=True):
        options = _options(token_scores)
        live = _best((new for old in live for new in _replaced(old, options)), beam)
        live = _inserted(live, slot_scores, beam)
    return live


def _substituted(tokens: Scores, beam: int) -> list[_Edited]:
    """Without insertions and deletions a program keeps its length."""
    live = [_Edited((), 0.0, GrammarState.start(), len(tokens))]
    for scores in tokens:
        masked = ((old, np.where(old.allowed_if_substituted(), scores, -np.inf)) for old in live)
        live = _best((new for old, allowed in masked for new in _replaced(old, _options(allowed))), beam)
    return live


def _options(scores: Scores) -> list[tuple[int, float]]:
    """The tokens worth looking at, with their scores."""
    return [(int(i), float(scores[i])) for i in np.flatnonzero(scores > scores.max() - _PRUNE)]


def _replaced(old: _Edited, options: Sequence[tuple[int, float]]) -> Iterator[_Edited]:
    for token, score in options:
        new = old.scored(score) if token == DELETE else old.extended(token, score)
        if new is not None:
            yield new


def _inserted(live: list[_Edited], slots: Scores, beam: int) -> list[_Edited]:
    """All that can stand in a gap: tokens in the first slots, then nothing."""
    rest = slots[::-1, NOTHING].cumsum()[::-1]  # of nothing in this slot and in all behind it
    closed: list[_Edited] = []
    for scores, nothing in zip(slots, rest, strict=True):
        closed += [h.scored(float(nothing)) for h in live]
        tokens = [option for option in _options(scores) if option[0] != NOTHING]
        if not tokens:
            break
        live = _best((new for old in live for new in _replaced(old, tokens)), beam)
    else:
        closed += live
    return _best(iter(closed), beam) if len(closed) > beam else closed


def _best(hypotheses: Iterator[_Edited], beam: int) -> list[_Edited]:
    """The most probable hypotheses; of equal left parts the better one."""
    kept: dict[Any, _Edited] = {}
    for h in sorted(hypotheses, key=lambda h: -h.score):
        kept.setdefault(h.tokens, h)
        if len(kept) == beam:
            break
    return list(kept.values())


class EditTargets(NamedTuple):
    """What is to be predicted: each token's replacement, and what stands in each slot; -1 is padding."""

    tokens: Int[Tensor, "batch time"]
    slots: Int[Tensor, "batch time slot"]


class ParallelEdits(nn.Module):
    """A linear layer for the replacement of each token, and one for what is inserted behind it.

    Args:
        memory: size of a token's representation.
        dropout: on the representations.
        slots: how many tokens can be inserted in a gap; with 0, tokens are substituted and nothing else:
            what would have to be inserted or deleted is not learned.
    """

    def __init__(self, memory: int, dropout: float = 0.2, slots: int = SLOTS) -> None:
        super().__init__()
        self.slots = slots
        self.dropout = nn.Dropout(dropout)
        self.replace = nn.Linear(memory, len(VOCAB))
        self.insert = nn.Linear(memory, slots * len(VOCAB)) if slots else None

    def forward(
        self, memory: Float[Tensor, "batch time memory"]
    ) -> tuple[Float[Tensor, "batch time vocab"], Float[Tensor, "batch time slot vocab"]]:
        """Logits of each token's replacement, and of what is inserted in the gap behind it."""
        memory = self.dropout(memory)
        replace = self.replace(memory)
        if self.insert is None:
            replace[..., DELETE] = -torch.inf
            return replace, memory.new_zeros(*memory.shape[:2], 0, len(VOCAB))
        return replace, self.insert(memory).unflatten(-1, (self.slots, -1))

    def targets(
        self, before: Sequence[Program], after: Sequence[Program], device: torch.device
    ) -> EditTargets:
        """The edits that turn programs into others, as tensors."""
        wanted = [edit_targets(b, a, self.slots) for b, a in zip(before, after, strict=True)]
        tokens = pad([replace for replace, _ in wanted], -1)
        slots = np.full((*tokens.shape, self.slots), -1)
        for row, (_, inserts) in zip(slots, wanted, strict=True):
            row[: len(inserts)] = inserts
        if not self.slots:
            tokens[tokens == DELETE] = -1
        return EditTargets(tokens.to(device), torch.from_numpy(slots).to(device))

    def loss(
        self, memory: Float[Tensor, "batch pair time memory"], targets: EditTargets
    ) -> Float[Tensor, ""]:
        """Cross-entropy of the edits, a mean over a program's tokens, then over programs (Eq. 3)."""
        replace, insert = self(memory.amax(1))
        losses = _cross_entropy(replace, targets.tokens) + _cross_entropy(insert, targets.slots).sum(2)
        return (losses.sum(1) / (targets.tokens >= 0).sum(1).clamp(min=1)).mean()

    def decode(
        self, memory: Float[Tensor, "batch pair time memory"], before: Sequence[Program], beam: int
    ) -> list[Iterator[Program]]:
        """For each program what it may become, most probable first; everything parses."""
        replace, insert = (logits.float().log_softmax(-1).cpu().numpy() for logits in self(memory.amax(1)))
        lengths = [len(program.tokens) for program in before]
        rows = zip(replace, insert, lengths, strict=True)
        return [decode_edits(r[:length], i[:length], beam) for r, i, length in rows]


def _cross_entropy(
    logits: Float[Tensor, "*where vocab"], wanted: Int[Tensor, "*where"]
) -> Float[Tensor, "*where"]:
    flat = F.cross_entropy(logits.float().flatten(0, -2), wanted.flatten(), ignore_index=-1, reduction="none")
    return flat.view(wanted.shape)
