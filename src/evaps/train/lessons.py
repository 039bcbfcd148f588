"""Programs to be learned token by token, with the grammar's masks, in arrays that batches are cut from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Int
from torch import Tensor

from evaps.dsl import VOCAB, GrammarState
from evaps.dsl.sampler import MAX_TOKENS
from evaps.models.compute import device


@dataclass(frozen=True)
class Lessons:
    """All programs of a training, padded to the longest.

    Attributes:
        tokens: their ids; 0 is padding.
        masks: which tokens the grammar allowed at each place.
    """

    tokens: Int[np.ndarray, "program time"]
    masks: Bool[np.ndarray, "program time vocab"]

    @classmethod
    def of(cls, programs: Sequence[Sequence[int]]) -> Lessons:
        """Of programs by their token ids."""
        longest = max(map(len, programs))
        tokens = np.zeros((len(programs), longest), np.int64)
        masks = np.zeros((len(programs), longest, len(VOCAB)), np.bool_)
        for row, program in enumerate(programs):
            tokens[row, : len(program)] = program
            state = GrammarState.start()
            for time, token in enumerate(program):
                masks[row, time] = state.allowed_within(MAX_TOKENS - time)
                state = state.advance(token)
        return cls(tokens, masks)

    @property
    def lengths(self) -> list[int]:
        """Tokens of each program."""
        return np.count_nonzero(self.tokens, axis=1).tolist()

    def batch(self, rows: Iterable[int]) -> tuple[Tensor, Tensor]:
        """Tokens ``[batch, time]`` and masks ``[batch, time, vocab]`` of programs, on the device."""
        chosen = np.fromiter(rows, np.int64)
        tokens = self.tokens[chosen]
        longest = np.count_nonzero(tokens, axis=1).max()
        moved = (tokens[:, :longest], self.masks[chosen, :longest])
        return torch.from_numpy(moved[0]).to(device()), torch.from_numpy(moved[1]).to(device())
