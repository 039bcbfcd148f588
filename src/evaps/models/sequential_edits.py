"""Edits one after the other: what to learn, what is allowed, and a decoder that writes them.

The form of the edit decoder in Gupta et al., "Synthesize, Execute and Debug", NeurIPS 2020: a pointer walks
over the wrong program; at each step its token is kept, deleted or replaced, or a token is inserted before it.
Each choice knows the earlier ones, so that edits which belong together are made together.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F

from evaps.dsl import VOCAB, GrammarState, Program
from evaps.dsl.alignment import align
from evaps.dsl.sampler import MAX_TOKENS
from evaps.models.base import pad
from evaps.models.beam import Chosen, search
from evaps.models.edit_steps import EditSteps

KEEP, DELETE = 0, 1
INSERT, REPLACE = 2, 2 + len(VOCAB)  # plus the token's id
EDITS = 2 + 2 * len(VOCAB)
_LONGEST = 2 * MAX_TOKENS  # every token of one program deleted, every token of another inserted


def edits_between(before: Program, after: Program) -> list[int]:
    """The edits that turn one program into another, by a shortest alignment; the last one is a KEEP."""
    choices = {
        "keep": lambda edit: KEEP,
        "delete": lambda edit: DELETE,
        "insert": lambda edit: INSERT + VOCAB.ids[edit.new],
        "replace": lambda edit: REPLACE + VOCAB.ids[edit.new],
    }
    return [choices[edit.kind](edit) for edit in align(before.tokens, after.tokens)]


@dataclass(frozen=True)
class Edited:
    """A program whose left part is edited.

    The last token, which closes every program, is kept and stands nowhere else: it ends the editing.

    Attributes:
        before: ids of the program's tokens.
        pointer: the next token of it.
        tokens: ids of what the left part became.
        grammar: what may follow it.
    """

    before: tuple[int, ...]
    pointer: int
    tokens: tuple[int, ...]
    grammar: GrammarState

    @classmethod
    def start(cls, program: Program) -> Edited:
        """Nothing is edited yet."""
        return cls(tuple(VOCAB.encode(program.tokens)), 0, (), GrammarState.start())

    @property
    def finished(self) -> bool:
        """Whether the result is a whole program."""
        return self.grammar.finished

    def allowed(self) -> NDArray[np.bool_]:
        """Which edits lead to a program of at most MAX_TOKENS: bool ``[EDITS]``."""
        fits = self.grammar.allowed_within(MAX_TOKENS - len(self.tokens))
        current, closing = self.before[self.pointer], self.before[-1]
        last = self.pointer == len(self.before) - 1
        mask = np.zeros(EDITS, np.bool_)
        mask[KEEP], mask[DELETE] = fits[current], not last
        mask[INSERT:REPLACE] = fits
        mask[INSERT + closing] = False
        if not last:
            mask[REPLACE:] = fits
            mask[[REPLACE + closing, REPLACE + current]] = False
        return mask

    def advance(self, choice: int) -> Edited:
        """With one more edit."""
        token = self.before[self.pointer] if choice == KEEP else written_token(choice)
        pointer = self.pointer + (not INSERT <= choice < REPLACE)
        if choice == DELETE:
            return Edited(self.before, pointer, self.tokens, self.grammar)
        return Edited(self.before, pointer, (*self.tokens, token), self.grammar.advance(token))


def written_token(choice: int) -> int:
    """The id of the token that an INSERT or a REPLACE writes."""
    return (choice - INSERT) % len(VOCAB)


@dataclass(frozen=True)
class Lesson:
    """The way from a wrong program to its target, edit by edit.

    Attributes:
        choices: the edits.
        pointers: where in the wrong program each one happens.
        written: the token that was written last before it; 0 if none was.
        masks: which edits were allowed, ``[edit, EDITS]``.
    """

    choices: list[int]
    pointers: list[int]
    written: list[int]
    masks: NDArray[np.bool_]

    @classmethod
    @lru_cache(maxsize=100_000)  # the same ones come up in every epoch
    def of(cls, before: Program, after: Program) -> Lesson:
        """By a shortest alignment."""
        partial, choices = Edited.start(before), edits_between(before, after)
        pointers, written, masks = [], [], []
        for choice in choices:
            pointers.append(partial.pointer)
            written.append((partial.tokens or (0,))[-1])
            masks.append(partial.allowed())
            partial = partial.advance(choice)
        return cls(choices, pointers, written, np.stack(masks))


class Told(NamedTuple):
    """Before each edit: the edit before it, the token that was written last, and where the pointer is."""

    last: Int[Tensor, "batch edit"]
    written: Int[Tensor, "batch edit"]
    pointers: Int[Tensor, "batch edit"]


class EditTargets(NamedTuple):
    """What is to be predicted: the edits (-1 is padding), what was allowed, and what is told before each."""

    choices: Int[Tensor, "batch edit"]
    masks: Bool[Tensor, "batch edit choice"]
    told: Told


class SequentialEdits(nn.Module):
    """An LSTM over the edits, which sees the token at the pointer: one for each pair, max-pooled over them.

    Args:
        memory: size of a token's representation.
        hidden: of the LSTM, and of an edit's embedding.
        layers: of the LSTM.
        dropout: on what goes into the LSTM and on what comes out.
        last_token: whether the LSTM is also told the token that was written last.
    """

    def __init__(
        self, memory: int, hidden: int, layers: int = 2, dropout: float = 0.2, last_token: bool = False
    ) -> None:
        super().__init__()
        self.edit = nn.Embedding(EDITS + 1, hidden)  # the last one stands for the start
        self.written = nn.Embedding(len(VOCAB), hidden) if last_token else None  # <pad>: nothing yet
        told = (1 + last_token) * hidden
        self.lstm = nn.LSTM(told + memory, hidden, layers, batch_first=True)
        self.norm = nn.LayerNorm(memory)  # without it, large values saturate the LSTM
        self.dropout = nn.Dropout(dropout)
        self.output = nn.Linear(hidden + memory, EDITS)

    def targets(
        self, before: Sequence[Program], after: Sequence[Program], device: torch.device
    ) -> EditTargets:
        """The edits that turn programs into others, as tensors."""
        lessons = [Lesson.of(b, a) for b, a in zip(before, after, strict=True)]
        choices = pad([lesson.choices for lesson in lessons], -1)
        masks = np.ones((*choices.shape, EDITS), np.bool_)
        for mask, lesson in zip(masks, lessons, strict=True):
            mask[: len(lesson.choices)] = lesson.masks
        told = Told(
            F.pad(choices[:, :-1].clamp(min=0), (1, 0), value=EDITS).to(device),
            pad([lesson.written for lesson in lessons]).to(device),
            pad([lesson.pointers for lesson in lessons]).to(device),
        )
        return EditTargets(choices.to(device), torch.from_numpy(masks).to(device), told)

    def loss(
        self, memory: Float[Tensor, "batch pair time memory"], targets: EditTargets
    ) -> Float[Tensor, ""]:
        """Cross-entropy of the edits, a mean over those of a program, then over programs."""
        logits = self(memory, targets.told).float().masked_fill(~targets.masks, -torch.inf)
        choices = targets.choices
        losses = F.cross_entropy(logits.transpose(1, 2), choices, ignore_index=-1, reduction="none")
        return (losses.sum(1) / (choices >= 0).sum(1)).mean()

    def forward(
        self, memory: Float[Tensor, "batch pair time memory"], told: Told
    ) -> Float[Tensor, "batch edit choice"]:
        """Logits of each edit; a row of the LSTM is a pair of a program."""
        pairs = memory.shape[1]
        pointed = F.one_hot(told.pointers, memory.shape[2]).to(memory.dtype)  # quicker than indexing
        token = self.dropout(self.norm(pointed[:, None] @ memory))
        known = [self.dropout(self.edit(told.last))]
        if self.written is not None:
            known.append(self.dropout(self.written(told.written)))
        given = torch.cat(known, -1)[:, None].expand(-1, pairs, -1, -1)
        outputs, _ = self.lstm(torch.cat([given, token], -1).flatten(0, 1))
        pooled = outputs.unflatten(0, (-1, pairs)).amax(1), token.amax(1)
        return self.output(torch.cat([self.dropout(pooled[0]), pooled[1]], -1))

    def decode(
        self, memory: Float[Tensor, "batch pair time memory"], before: Sequence[Program], beam: int
    ) -> list[Iterator[Program]]:
        """For each program what it may become, most probable first; everything parses."""
        steps = EditSteps(self, memory)
        last = torch.full((len(memory),), EDITS, device=memory.device)

        def step(partials: Sequence[Edited], chosen: Chosen | None) -> Tensor:
            nonlocal last
            if chosen is not None:
                rows, last = chosen
                steps.select(rows)
            pointers = torch.tensor([p.pointer for p in partials], device=memory.device)
            written = torch.tensor([(p.tokens or (0,))[-1] for p in partials], device=memory.device)
            return steps.step(last, written, pointers)

        found = search([Edited.start(program) for program in before], step, beam, _LONGEST)
        return [map(Program.from_ids, dict.fromkeys(h.partial.tokens for h in group)) for group in found]
