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
    """The decoder between two steps: each task's pairs, and for each layer the tokens' keys and values."""

    memory: Float[Tensor, "batch pair hidden"]
    seen: Float[Tensor, "layer 2 batch time hidden"]


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
        memory = self.memory(self.dropout(pairs))
        nothing = memory.new_zeros(self.config.layers, 2, len(features), 0, self.config.hidden)
        return TransformerState(memory, nothing)

    def step(
        self,
        state: TransformerState,
        tokens: Int[Tensor, " batch"] | None,
        rows: Int[Tensor, " batch"] | None,
    ) -> tuple[Float[Tensor, "batch vocab"], TransformerState]:
        """One token further; see `Synthesizer.step`."""
        memory, before = state.memory, state.seen
        if rows is not None:
            memory, before = memory[rows], before[:, :, rows]
        if tokens is None:
            tokens = torch.zeros(len(memory), dtype=torch.long, device=memory.device)
        x = self.dropout(self.token(tokens) + self.position.weight[before.shape[3]])[:, None]
        seen, norm = [], self.decoder.norm
        assert norm is not None
        for layer, earlier in zip(self.decoder.layers, before, strict=True):
            x, known = _one_token(layer, x, earlier, memory.to(x.dtype))
            seen.append(known)
        return self.output(norm(x[:, 0])), TransformerState(memory, torch.stack(seen))

    def logits(
        self, features: Features, tokens: Int[Tensor, "batch time"]
    ) -> Float[Tensor, "batch time vocab"]:
        """See `Synthesizer.logits`."""
        return self._decode(self.start(features).memory, F.pad(tokens[:, :-1], (1, 0)))

    def _decode(
        self, memory: Float[Tensor, "batch pair hidden"], tokens: Int[Tensor, "batch time"]
    ) -> Float[Tensor, "batch time vocab"]:
        time = tokens.shape[1]
        x = self.token(tokens) + self.position(torch.arange(time, device=tokens.device))
        causal = nn.Transformer.generate_square_subsequent_mask(time, device=tokens.device)
        hidden = self.decoder(self.dropout(x), memory.to(x.dtype), tgt_mask=causal, tgt_is_causal=True)
        return self.output(hidden)


def _one_token(
    layer: nn.TransformerDecoderLayer,
    x: Float[Tensor, "batch 1 hidden"],
    earlier: Float[Tensor, "2 batch time hidden"],
    memory: Float[Tensor, "batch pair hidden"],
) -> tuple[Float[Tensor, "batch 1 hidden"], Float[Tensor, "2 batch time+1 hidden"]]:
    """What a layer makes of the next token; keys and values of all tokens, its own among them."""
    attention = layer.self_attn
    projected = F.linear(layer.norm1(x), attention.in_proj_weight, attention.in_proj_bias)
    query, *now = projected.chunk(3, -1)
    seen = torch.cat([earlier.to(projected.dtype), torch.stack(now)], 2)
    heads = [each.unflatten(-1, (attention.num_heads, -1)).transpose(1, 2) for each in (query, *seen)]
    attended = F.scaled_dot_product_attention(*heads).transpose(1, 2).flatten(2)
    x = x + layer.dropout1(attention.out_proj(attended))
    x = x + layer.dropout2(layer.multihead_attn(layer.norm2(x), memory, memory, need_weights=False)[0])
    inner = layer.dropout(layer.activation(layer.linear1(layer.norm3(x))))
    return x + layer.dropout3(layer.linear2(inner)), seen
