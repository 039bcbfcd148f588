"""LGRL: an LSTM decoder per pair, pooled over pairs, that obeys the grammar.

Bunel et al., "Leveraging Grammar and Reinforcement Learning for Neural Program Synthesis", ICLR 2018. The
grammar's mask comes from the parser itself instead of a learned syntax model. This file holds the model and
its maximum-likelihood loss.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn import functional as F

from evaps.dsl import VOCAB
from evaps.models.base import Features, Synthesizer
from evaps.models.pairs import PairConfig, PairEmbedding
from evaps.models.recurrent import PairLSTM, select_hidden


@dataclass(frozen=True)
class LGRLConfig:
    """Sizes as in Bunel et al.: an LSTM of two layers of 256, pairs of 512."""

    feature: int = 256
    """Size of an observation's embedding."""
    pair: int = 512
    """Size of a pair's embedding."""
    embedding: int = 256
    """Size of a token's embedding."""
    hidden: int = 256
    """Size of the LSTM's state."""
    layers: int = 2
    """Layers of the LSTM."""
    dropout: float = 0.2
    """On the LSTM's input and output, against overfitting on few tasks (this project's choice)."""
    norm: bool = True
    """Whether the pairs' embeddings are normalised: stage 0 leaves them of all sizes up to 100."""


@dataclass(frozen=True)
class LGRLState:
    """The decoder between two steps: what the LSTM is told of each pair, and its state."""

    told: Float[Tensor, "batch pair size"]
    hidden: tuple[Float[Tensor, "layer batch_pair hidden"], Float[Tensor, "layer batch_pair hidden"]] | None


class LGRL(Synthesizer):
    """One LSTM per pair with shared weights; the top hidden states are max-pooled before the vocabulary."""

    name = "lgrl"
    Config: ClassVar[type] = LGRLConfig

    def __init__(self, config: LGRLConfig = LGRLConfig()) -> None:
        super().__init__()
        self.config = config
        self.pair = PairEmbedding(PairConfig(config.feature, config.pair))
        self.norm = nn.LayerNorm(config.pair) if config.norm else nn.Identity()
        self.embedding = nn.Embedding(len(VOCAB), config.embedding)  # <pad> stands for the start
        self.lstm = PairLSTM(config.embedding, config.pair, config.hidden, config.layers)
        self.dropout = nn.Dropout(config.dropout)
        self.output = nn.Linear(config.hidden, len(VOCAB))

    def start(self, features: Features) -> LGRLState:
        """Embed the pairs."""
        pair = self.norm(self.pair(features[:, :, 0], features[:, :, 1]))
        return LGRLState(self.lstm.told(self.dropout(pair)), None)

    def step(
        self, state: LGRLState, tokens: Int[Tensor, " batch"] | None, rows: Int[Tensor, " batch"] | None
    ) -> tuple[Float[Tensor, "batch vocab"], LGRLState]:
        """One token further; see `Synthesizer.step`."""
        if rows is not None:
            state = _select(state, rows)
        if tokens is None:
            tokens = torch.zeros(len(state.told), dtype=torch.long, device=state.told.device)
        logits, hidden = self._decode(state.told, tokens[:, None], state.hidden)
        return logits[:, 0], LGRLState(state.told, hidden)

    def logits(
        self, features: Features, tokens: Int[Tensor, "batch time"]
    ) -> Float[Tensor, "batch time vocab"]:
        """See `Synthesizer.logits`."""
        before = F.pad(tokens[:, :-1], (1, 0))
        return self._decode(self.start(features).told, before, None)[0]

    def _decode(
        self,
        told: Float[Tensor, "batch pair size"],
        tokens: Int[Tensor, "batch time"],
        hidden: tuple[Tensor, Tensor] | None,
    ) -> tuple[Float[Tensor, "batch time vocab"], tuple[Tensor, Tensor]]:
        outputs, hidden = self.lstm(self.dropout(self.embedding(tokens)), told, hidden)
        pooled = outputs.unflatten(0, told.shape[:2]).amax(1)
        return self.output(self.dropout(pooled)), hidden


def _select(state: LGRLState, rows: Int[Tensor, " batch"]) -> LGRLState:
    hidden = state.hidden
    if hidden is not None:
        hidden = select_hidden(hidden, rows, state.told.shape[1])
    return LGRLState(state.told[rows], hidden)
