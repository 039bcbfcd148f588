"""Transformer: a causal decoder whose memory is the pairs, in no order among them.

Vaswani et al., "Attention Is All You Need", NeurIPS 2017. The paper names the baseline and no sizes; layers,
width and heads are this project's choice. A position's embedding is learned; pairs have none.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn import functional as F

from evaps.dsl import VOCAB
from evaps.dsl.sampler import MAX_TOKENS
from evaps.models.base import Features, Synthesizer
from evaps.models.pairs import PairConfig, PairEmbedding


@dataclass(frozen=True)
class TransformerConfig:
    """Sizes; all are this project's choice."""

    feature: int = 256
    """Size of an observation's embedding."""
    pair: int = 512
    """Size of a pair's embedding."""
    hidden: int = 256
    """Size of a token's representation."""
    layers: int = 4
    """Decoder layers."""
    heads: int = 8
    """Attention heads."""
    dropout: float = 0.2
    """In every layer, and on the pairs."""


@dataclass(frozen=True)
class TransformerState:
    """The decoder between two steps: each task's pairs, and the tokens so far."""

    memory: Float[Tensor, "batch pair hidden"]
    tokens: Int[Tensor, "batch time"]


class Transformer(Synthesizer):
    """Self-attention over the tokens so far, cross-attention to the pairs."""

    name = "transformer"
    Config: ClassVar[type] = TransformerConfig

    def __init__(self, config: TransformerConfig = TransformerConfig()) -> None:
        super().__init__()
        self.config = config
        size = config.hidden
        self.pair = PairEmbedding(PairConfig(config.feature, config.pair))
        self.norm = nn.LayerNorm(config.pair)
        self.memory = nn.Linear(config.pair, size)
        self.token = nn.Embedding(len(VOCAB), size)  # <pad> stands for the start
        self.position = nn.Embedding(MAX_TOKENS, size)
        layer = nn.TransformerDecoderLayer(
            size, config.heads, 4 * size, config.dropout, batch_first=True, norm_first=True
        )
        self.decoder = nn.TransformerDecoder(layer, config.layers, nn.LayerNorm(size))
        self.dropout = nn.Dropout(config.dropout)
        self.output = nn.Linear(size, len(VOCAB))

    def start(self, features: Features) -> TransformerState:
        """Embed the pairs."""
        pairs = self.norm(self.pair(features[:, :, 0], features[:, :, 1]))
        nothing = torch.zeros(len(features), 0, dtype=torch.long, device=features.device)
        return TransformerState(self.memory(self.dropout(pairs)), nothing)

    def step(
        self,
        state: TransformerState,
        tokens: Int[Tensor, " batch"] | None,
        rows: Int[Tensor, " batch"] | None,
    ) -> tuple[Float[Tensor, "batch vocab"], TransformerState]:
        """One token further; see :meth:`Synthesizer.step`."""
        memory, before = state.memory, state.tokens
        if rows is not None:
            memory, before = memory[rows], before[rows]
        if tokens is None:
            tokens = torch.zeros(len(memory), dtype=torch.long, device=memory.device)
        before = torch.cat([before, tokens[:, None]], 1)
        return self._decode(memory, before)[:, -1], TransformerState(memory, before)

    def logits(
        self, features: Features, tokens: Int[Tensor, "batch time"]
    ) -> Float[Tensor, "batch time vocab"]:
        """See :meth:`Synthesizer.logits`."""
        return self._decode(self.start(features).memory, F.pad(tokens[:, :-1], (1, 0)))

    def _decode(
        self, memory: Float[Tensor, "batch pair hidden"], tokens: Int[Tensor, "batch time"]
    ) -> Float[Tensor, "batch time vocab"]:
        time = tokens.shape[1]
        x = self.token(tokens) + self.position(torch.arange(time, device=tokens.device))
        causal = nn.Transformer.generate_square_subsequent_mask(time, device=tokens.device)
        hidden = self.decoder(self.dropout(x), memory.to(x.dtype), tgt_mask=causal, tgt_is_causal=True)
        return self.output(hidden)
