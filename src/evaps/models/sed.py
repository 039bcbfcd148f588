"""SED: repairs a program token by token, with the states that each of its tokens was executed in.

Gupta et al., "Synthesize, Execute and Debug: Learning to Repair for Neural Program Synthesis", NeurIPS 2020.
A bidirectional LSTM reads the wrong program; its trace embedding adds to each token what the robot saw at the
events that the token stands for; an edit decoder runs for each pair, and the pairs are max-pooled.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn import functional as F

from evaps.dsl import VOCAB, Program
from evaps.models.base import Execution, Joined, Repairer
from evaps.models.pairs import PairConfig, PairEmbedding
from evaps.models.recurrent import BothWays
from evaps.models.sequential_edits import SequentialEdits


@dataclass(frozen=True)
class SEDConfig:
    """Sizes as in Gupta et al.: LSTMs of two layers of 256."""

    feature: int = 256
    """Size of an observation's embedding."""
    pair: int = 512
    """Size of a pair's embedding."""
    hidden: int = 256
    """Size of a token's representation and of the LSTMs."""
    layers: int = 2
    """Of both LSTMs."""
    dropout: float = 0.2
    """Against overfitting on few tasks (this project's choice)."""
    beam: int = 4
    """Edited left parts kept while decoding."""


@dataclass(frozen=True)
class SEDBatch:
    """Executions as tensors. ``segment`` counts through all programs of the batch."""

    tokens: Int[Tensor, "batch time"]
    segments: Int[Tensor, "batch time"]
    owner: Int[Tensor, " segment"]
    events: Int[Tensor, "event 3"]  # pair, segment, row of what was seen before it
    first: Int[Tensor, "batch pair"]
    goal: Int[Tensor, "batch pair"]

    @classmethod
    def of(cls, executions: Sequence[Execution], device: torch.device) -> SEDBatch:
        """Join executions; programs are padded to the longest."""
        joined = Joined.of([e.program for e in executions], device)
        each = zip(executions, joined.starts, strict=True)
        arrays = [
            np.concatenate([np.add(e.events, [0, start, 0]) for e, start in each]),
            np.stack([e.first for e in executions]),
            np.stack([e.goal for e in executions]),
        ]
        moved = [torch.from_numpy(a.astype(np.int64)).to(device) for a in arrays]
        return cls(joined.tokens, joined.segments, joined.owner, *moved)


class SED(Repairer):
    """Token memory ``h + TraceEmbed`` for each pair, then edits one after the other."""

    name = "sed"
    Config: ClassVar[type] = SEDConfig

    def __init__(self, config: SEDConfig = SEDConfig()) -> None:
        super().__init__()
        self.config = config
        size = config.hidden
        self.pair = PairEmbedding(PairConfig(config.feature, config.pair))
        self.token = nn.Embedding(len(VOCAB), size, padding_idx=0)
        self.read = BothWays(size, config.layers, config.dropout)
        self.event = nn.Linear(3 * config.feature, size)
        self.given = nn.Linear(config.pair, size)
        self.edits = SequentialEdits(2 * size, size, config.layers, config.dropout, last_token=True)

    def forward(
        self, batch: SEDBatch, table: Float[Tensor, "row feature"]
    ) -> Float[Tensor, "batch pair time memory"]:
        """For each pair and token: the token in its context and its events, beside the pair's embedding."""
        program = self.read(self.token(batch.tokens), batch.tokens > 0)
        traces = self.trace_embed(batch, table)[batch.segments].transpose(1, 2)
        pair = self.given(self.pair(table[batch.first], table[batch.goal]))
        beside = pair[:, :, None].expand(-1, -1, program.shape[1], -1)
        return torch.cat([program[:, None] + traces, beside], -1)

    def trace_embed(
        self, batch: SEDBatch, table: Float[Tensor, "row feature"]
    ) -> Float[Tensor, "segment pair hidden"]:
        """For each segment and pair the mean over its events of [state before | input | output], or 0."""
        pair, segment, row = batch.events.unbind(1)
        task = batch.owner[segment]
        seen = [table[row], table[batch.first[task, pair]], table[batch.goal[task, pair]]]
        events = F.relu(self.event(torch.cat(seen, -1)))
        pairs = batch.goal.shape[1]
        at = segment * pairs + pair
        slots = len(batch.owner) * pairs
        total = events.new_zeros(slots, events.shape[1]).index_add(0, at, events)
        count = torch.bincount(at, minlength=slots).clamp(min=1)
        return (total / count[:, None]).unflatten(0, (-1, pairs))

    def batch(
        self, executions: Sequence[Execution], targets: Sequence[Program], device: torch.device
    ) -> tuple[SEDBatch, Any]:
        """See `Repairer.batch`."""
        programs = [e.program for e in executions]
        return SEDBatch.of(executions, device), self.edits.targets(programs, targets, device)

    def batch_loss(
        self, batch: tuple[SEDBatch, Any], table: Float[Tensor, "row feature"]
    ) -> Float[Tensor, ""]:
        """Cross-entropy of the Levenshtein edits, a mean over a program's edits, then over programs."""
        return self.edits.loss(self(batch[0], table), batch[1])

    @torch.inference_mode()
    def repairs(
        self, executions: Sequence[Execution], table: Float[Tensor, "row feature"], beam: int
    ) -> list[Iterator[Program]]:
        """See `Repairer.repairs`."""
        memory = self(SEDBatch.of(executions, table.device), table)
        return self.edits.decode(memory, [e.program for e in executions], beam)
