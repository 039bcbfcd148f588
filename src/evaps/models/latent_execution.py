"""Latent Execution: a decoder that imagines what the statements it has written do.

Chen et al., "Latent Execution for Neural Program Synthesis Beyond Domain-Specific Languages", NeurIPS 2021.
Theirs is for C and integers; this port keeps the idea. An executor cell changes a latent state of each
pair after every statement; the decoder reads that state in the place of the input's embedding; and the
state in which the gold program ends has to agree with the output's embedding. There is no operation
predictor, which is about integers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn import functional as F

from evaps.dsl import VOCAB, token_type
from evaps.models.base import Features, Synthesizer, masked_likelihood
from evaps.models.pairs import PairConfig, PairEmbedding
from evaps.models.recurrent import one_step, select_hidden

_ENDS = torch.tensor([token_type(t) == "action" or t in ("i)", "e)", "w)", "r)") for t in VOCAB.tokens])
"""Which tokens end a statement or a branch: there the executor runs."""


@dataclass(frozen=True)
class LatentExecutionConfig:
    """Sizes as LGRL's, so that the comparison is about the method."""

    feature: int = 256
    """Size of an observation's embedding, and of the latent state."""
    pair: int = 512
    """Size of a pair's embedding."""
    hidden: int = 256
    """Size of a token's embedding and of the LSTM's state."""
    layers: int = 2
    """Layers of the LSTM."""
    dropout: float = 0.2
    """On the LSTM's input and output (this project's choice)."""
    agreement: float = 0.1
    """Weight of the agreement of the last latent state with the output."""
    temperature: float = 0.1
    """Of the agreement, in which the outputs of the other pairs are the wrong answers."""


@dataclass(frozen=True)
class LatentState:
    """The decoder between two steps; rows are tasks, and in ``hidden`` the pairs of each."""

    latent: Float[Tensor, "batch pair feature"]
    goal: Float[Tensor, "batch pair feature"]
    given: Float[Tensor, "batch pair size"]
    hidden: tuple[Float[Tensor, "layer batch_pair hidden"], Float[Tensor, "layer batch_pair hidden"]]


class LatentExecution(Synthesizer):
    """One LSTM per pair over [token | embedding of (latent state, output)], max-pooled over the pairs."""

    name = "latent-execution"
    retrains = True
    Config: ClassVar[type] = LatentExecutionConfig

    def __init__(self, config: LatentExecutionConfig = LatentExecutionConfig()) -> None:
        super().__init__()
        self.config = config
        self.pair = PairEmbedding(PairConfig(config.feature, config.pair))
        self.norm = nn.LayerNorm(config.pair)
        self.embedding = nn.Embedding(len(VOCAB), config.hidden)  # <pad> stands for the start
        self.lstm = nn.LSTM(config.hidden + config.pair, config.hidden, config.layers)
        self.executor = nn.Sequential(
            nn.Linear(config.feature + 2 * config.hidden, config.hidden),
            nn.ReLU(),
            nn.Linear(config.hidden, config.feature),
        )
        self.dropout = nn.Dropout(config.dropout)
        self.output = nn.Linear(config.hidden, len(VOCAB))

    def start(self, features: Features) -> LatentState:
        """The latent state is the input's embedding."""
        rows = features.shape[0] * features.shape[1]
        zeros = features.new_zeros(self.config.layers, rows, self.config.hidden)
        latent, goal = features[:, :, 0], features[:, :, 1]
        return LatentState(latent, goal, self.norm(self.pair(latent, goal)), (zeros, zeros))

    def step(
        self, state: LatentState, tokens: Int[Tensor, " batch"] | None, rows: Int[Tensor, " batch"] | None
    ) -> tuple[Float[Tensor, "batch vocab"], LatentState]:
        """One token further; see `Synthesizer.step`."""
        if rows is not None:
            state = _select(state, rows)
        if tokens is None:
            tokens = torch.zeros(len(state.goal), dtype=torch.long, device=state.goal.device)
        token = self.embedding(tokens)
        ends = _ENDS.to(tokens.device)[tokens].nonzero()[:, 0]
        if len(ends):
            state = self._execute(state, token, ends)
        pairs = state.goal.shape[1]
        told = self.dropout(token)[:, None].expand(-1, pairs, -1)
        inputs = torch.cat([told, self.dropout(state.given)], -1).flatten(0, 1)
        outputs, hidden = one_step(self.lstm, inputs, state.hidden)
        pooled = outputs.unflatten(0, (-1, pairs)).amax(1)
        return self.output(self.dropout(pooled)), replace(state, hidden=hidden)

    def _execute(
        self, state: LatentState, token: Float[Tensor, "batch hidden"], ends: Int[Tensor, " end"]
    ) -> LatentState:
        """Where a token ends a statement: what the world may look like after it."""
        top = state.hidden[0][-1].unflatten(0, state.goal.shape[:2])[ends]
        told = token[ends, None].expand_as(top)
        latent = state.latent[ends]
        latent = latent + self.executor(torch.cat([latent, top, told], -1)).to(latent.dtype)
        given = self.norm(self.pair(latent, state.goal[ends])).to(state.given.dtype)
        return replace(
            state,
            latent=state.latent.index_copy(0, ends, latent),
            given=state.given.index_copy(0, ends, given),
        )

    def loss(
        self, features: Features, tokens: Int[Tensor, "batch time"], masks: Bool[Tensor, "batch time vocab"]
    ) -> Float[Tensor, ""]:
        """Likelihood of the program, and agreement of each pair's last latent state with its output."""
        logits, last = self._read(features, tokens)
        likelihood = masked_likelihood(logits, tokens, masks).sum() / (tokens > 0).sum()
        return likelihood + self.config.agreement * self._disagreement(last, features, tokens)

    def logits(
        self, features: Features, tokens: Int[Tensor, "batch time"]
    ) -> Float[Tensor, "batch time vocab"]:
        """See `Synthesizer.logits`."""
        return self._read(features, tokens)[0]

    def _read(
        self, features: Features, tokens: Int[Tensor, "batch time"]
    ) -> tuple[Float[Tensor, "batch time vocab"], Float[Tensor, "batch pair feature"]]:
        state, logits = self.start(features), []
        for before in F.pad(tokens[:, :-1], (1, 0)).unbind(1):
            scores, state = self.step(state, before, None)
            logits.append(scores)
        return torch.stack(logits, 1), state.latent

    def _disagreement(
        self,
        last: Float[Tensor, "batch pair feature"],
        features: Features,
        tokens: Int[Tensor, "batch time"],
    ) -> Float[Tensor, ""]:
        """InfoNCE among the pairs of a task, so that states cannot collapse; weighed by its tokens."""
        goals = F.normalize(features[:, :, 1].detach().float(), dim=-1)
        alike = F.normalize(last.float(), dim=-1) @ goals.transpose(1, 2) / self.config.temperature
        own = torch.arange(alike.shape[1], device=alike.device).expand(len(alike), -1)
        losses = F.cross_entropy(alike.transpose(1, 2), own, reduction="none").mean(1)
        weights = (tokens > 0).sum(1) / (tokens > 0).sum()
        return (losses * weights).sum()


def _select(state: LatentState, rows: Int[Tensor, " batch"]) -> LatentState:
    hidden = select_hidden(state.hidden, rows, state.goal.shape[1])
    return LatentState(state.latent[rows], state.goal[rows], state.given[rows], hidden)
