"""A method of your own: a synthesizer in one class. docs/own-method.md says how evaps comes to know it."""

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from evaps.dsl import VOCAB
from evaps.models.base import Synthesizer
from evaps.models.pairs import PairConfig, PairEmbedding


@dataclass(frozen=True)
class MeanConfig:
    """Its sizes; a checkpoint keeps them."""

    feature: int = 256
    pair: int = 512
    hidden: int = 256
    dropout: float = 0.2


class Mean(Synthesizer):
    """The mean of the pairs' embeddings is all that a GRU knows of a task when it begins to write."""

    name = "mean"
    Config = MeanConfig

    def __init__(self, config: MeanConfig = MeanConfig()) -> None:
        super().__init__()
        self.config = config
        self.pair = PairEmbedding(PairConfig(config.feature, config.pair))  # starts from the inverse model
        self.begin = nn.Sequential(
            nn.LayerNorm(config.pair), nn.Linear(config.pair, config.hidden), nn.Tanh()
        )
        self.token = nn.Embedding(len(VOCAB), config.hidden)
        self.gru = nn.GRU(config.hidden, config.hidden, batch_first=True)
        self.dropout = nn.Dropout(config.dropout)
        self.output = nn.Linear(config.hidden, len(VOCAB))

    def start(self, features: Tensor) -> Tensor:
        """The state before the first token, from features [batch, pair, 2, feature]."""
        return self.begin(self.pair(features[:, :, 0], features[:, :, 1]).mean(1))[None]

    def step(self, state: Tensor, tokens: Tensor | None, rows: Tensor | None) -> tuple[Tensor, Tensor]:
        """Logits of the next token: the beam search calls this."""
        state = state if rows is None else state[:, rows]
        tokens = torch.zeros(state.shape[1], dtype=torch.long) if tokens is None else tokens
        outputs, state = self.gru(self.token(tokens.to(state.device))[:, None], state)
        return self.output(outputs[:, 0]), state

    def logits(self, features: Tensor, tokens: Tensor) -> Tensor:
        """Logits of every token of whole programs: the training calls this."""
        before = self.dropout(self.token(F.pad(tokens[:, :-1], (1, 0))))
        return self.output(self.dropout(self.gru(before, self.start(features))[0]))
