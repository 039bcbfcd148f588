"""Inferred Trace: first what to do, action by action, then the program that does it.

Shin, Polosukhin and Song, "Improving Neural Program Synthesis with Inferred Execution Traces", NeurIPS 2018.
A policy acts on each pair's scene until it says that it is done; what it saw and did there is the pair's
way. A decoder writes the program from the ways: it attends to each, and the pairs are max-pooled. A way that
misses the output counts for nothing: of it nothing is left but the learned vector that stands before each.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn import functional as F

from evaps.dsl import VOCAB
from evaps.dsl.sampler import ACTIONS, PERCEPTION_KEYS
from evaps.models.base import Synthesizer
from evaps.models.pairs import PairConfig, PairEmbedding
from evaps.models.recurrent import BothWays, PairLSTM, one_step, select_hidden

STOP = len(ACTIONS)
START = STOP + 1
"""No action: what is done at the end of a way, and what was done before its first action."""
Hidden = tuple[Tensor, Tensor]


@dataclass(frozen=True)
class Ways:
    """Ways on the pairs of tasks. At each time something was seen, and then something was done.

    Attributes:
        seen: embeddings of the observations.
        perceived: which perceptions were true.
        actions: what was done then: an index in ACTIONS, or STOP.
        real: which times belong to the way; none of a way that missed its goal.
        goal: the embedding of each pair's goal.
    """

    seen: Float[Tensor, "batch pair time feature"]
    perceived: Float[Tensor, "batch pair time perception"]
    actions: Int[Tensor, "batch pair time"]
    real: Bool[Tensor, "batch pair time"]
    goal: Float[Tensor, "batch pair feature"]

    def __len__(self) -> int:
        return len(self.goal)


@dataclass(frozen=True)
class InferredTraceConfig:
    """Sizes as LGRL's, so that the comparison is about the method."""

    feature: int = 256
    """Size of an observation's embedding."""
    pair: int = 512
    """Size of a pair's embedding."""
    hidden: int = 256
    """Size of a token's embedding and of the LSTMs' states."""
    layers: int = 2
    """Layers of the LSTMs."""
    dropout: float = 0.2
    """On what goes into the LSTMs and what comes out (this project's choice)."""


class Policy(nn.Module):
    """What to do next on a pair: an LSTM over [last action | view | perceptions | pair].

    The pair is that of the current view and the goal, which at the start is the pair of the input and the
    output: this project's reading.
    """

    def __init__(self, config: InferredTraceConfig) -> None:
        super().__init__()
        size = config.hidden
        self.pair = PairEmbedding(PairConfig(config.feature, config.pair))
        self.action = nn.Embedding(START + 1, size)
        self.view = nn.Linear(config.feature, size)
        given = 2 * size + len(PERCEPTION_KEYS) + config.pair
        self.lstm = nn.LSTM(given, size, config.layers, batch_first=True)
        self.dropout = nn.Dropout(config.dropout)
        self.output = nn.Linear(size + config.pair, STOP + 1)

    def forward(
        self,
        seen: Float[Tensor, "row time feature"],
        perceived: Float[Tensor, "row time perception"],
        goal: Float[Tensor, "row feature"],
        last: Int[Tensor, "row time"],
    ) -> Float[Tensor, "row time action"]:
        """Logits of what is done at each time, knowing what was done before it."""
        pair = self._pair(seen, goal[:, None].expand_as(seen))
        outputs, _ = self.lstm(self._given(seen, perceived, pair, last))
        return self._decide(outputs, pair)

    def start(self, rows: int) -> Hidden:
        """The LSTM's state before the first action."""
        zeros = self.output.weight.new_zeros(self.lstm.num_layers, rows, self.lstm.hidden_size)
        return zeros, zeros

    def step(
        self,
        seen: Float[Tensor, "row feature"],
        perceived: Float[Tensor, "row perception"],
        goal: Float[Tensor, "row feature"],
        last: Int[Tensor, " row"],
        hidden: Hidden,
    ) -> tuple[Float[Tensor, "row action"], Hidden]:
        """Logits of what is done now, and the LSTM's state, for who is on the way."""
        pair = self._pair(seen, goal)
        outputs, hidden = one_step(self.lstm, self._given(seen, perceived, pair, last), hidden)
        return self._decide(outputs, pair), hidden

    def _pair(self, seen: Tensor, goal: Tensor) -> Float[Tensor, "... pair"]:
        return self.dropout(self.pair(seen, goal))

    def _given(self, seen: Tensor, perceived: Tensor, pair: Tensor, last: Tensor) -> Tensor:
        return torch.cat([self.action(last), F.relu(self.view(seen)), perceived.to(pair.dtype), pair], -1)

    def _decide(self, outputs: Tensor, pair: Tensor) -> Float[Tensor, "... action"]:
        return self.output(torch.cat([self.dropout(outputs), pair], -1))

    def loss(self, ways: Ways) -> tuple[Float[Tensor, ""], Float[Tensor, ""]]:
        """Cross-entropy of what was done at each time, and the share that is predicted right."""
        actions = ways.actions.flatten(0, 1)
        last = F.pad(actions[:, :-1], (1, 0), value=START)
        flat = [x.flatten(0, 1) for x in (ways.seen, ways.perceived, ways.goal)]
        logits = self(*flat, last).float()
        real = ways.real.flatten(0, 1)
        right = (logits.argmax(-1) == actions)[real].float().mean()
        return F.cross_entropy(logits[real], actions[real]), right


@dataclass(frozen=True)
class TraceState:
    """The decoder between two steps; each task's pairs follow one another in memory and ``hidden``."""

    memory: Float[Tensor, "batch pair slot hidden"]
    there: Bool[Tensor, "batch pair slot"]
    told: Float[Tensor, "batch pair size"]
    hidden: Hidden | None = None


class InferredTrace(Synthesizer):
    """A bidirectional LSTM reads each pair's way, and an LSTM that attends to it writes the program."""

    name = "inferred-trace"
    acts = True
    Config: ClassVar[type] = InferredTraceConfig

    def __init__(self, config: InferredTraceConfig = InferredTraceConfig()) -> None:
        super().__init__()
        self.config = config
        size = config.hidden
        self.policy = Policy(config)
        self.pair = PairEmbedding(PairConfig(config.feature, config.pair))
        self.norm = nn.LayerNorm(config.pair)
        self.view = nn.Linear(config.feature + len(PERCEPTION_KEYS), size)
        self.action = nn.Embedding(START, size)
        self.read = BothWays(size, config.layers, config.dropout)
        self.nothing = nn.Parameter(torch.zeros(size))
        self.embedding = nn.Embedding(len(VOCAB), size)  # <pad> stands for the start
        self.lstm = PairLSTM(size, config.pair, size, config.layers)
        self.ask = nn.Linear(size, size)
        self.combine = nn.Linear(2 * size, size)
        self.dropout = nn.Dropout(config.dropout)
        self.output = nn.Linear(size, len(VOCAB))

    def start(self, ways: Ways) -> TraceState:
        """Read the ways."""
        views = torch.cat([ways.seen, ways.perceived.to(ways.seen.dtype)], -1)
        x = F.relu(self.view(views) + self.action(ways.actions)).flatten(0, 1)
        read = self.read(self.dropout(x), ways.real.flatten(0, 1)).unflatten(0, ways.real.shape[:2])
        nothing = self.nothing.to(read.dtype).expand(*read.shape[:2], 1, -1)
        there = F.pad(ways.real, (1, 0), value=True)
        pair = self.norm(self.pair(ways.seen[:, :, 0], ways.goal))
        return TraceState(torch.cat([nothing, read], 2), there, self.lstm.told(self.dropout(pair)))

    def step(
        self, state: TraceState, tokens: Int[Tensor, " batch"] | None, rows: Int[Tensor, " batch"] | None
    ) -> tuple[Float[Tensor, "batch vocab"], TraceState]:
        """One token further; see `Synthesizer.step`."""
        if rows is not None:
            state = _select(state, rows)
        if tokens is None:
            tokens = torch.zeros(len(state.told), dtype=torch.long, device=state.told.device)
        logits, state = self._decode(state, tokens[:, None])
        return logits[:, 0], state

    def logits(self, ways: Ways, tokens: Int[Tensor, "batch time"]) -> Float[Tensor, "batch time vocab"]:
        """See `Synthesizer.logits`."""
        return self._decode(self.start(ways), F.pad(tokens[:, :-1], (1, 0)))[0]

    def _decode(
        self, state: TraceState, tokens: Int[Tensor, "batch time"]
    ) -> tuple[Float[Tensor, "batch time vocab"], TraceState]:
        """Attention as in Luong et al. (2015): after the LSTM, so that a whole program is one call."""
        outputs, hidden = self.lstm(self.dropout(self.embedding(tokens)), state.told, state.hidden)
        outputs = self.dropout(outputs.unflatten(0, state.told.shape[:2]))
        memory = state.memory.to(outputs.dtype)
        scores = self.ask(outputs) @ memory.transpose(2, 3) / self.config.hidden**0.5
        scores = scores.float().masked_fill(~state.there[:, :, None], -torch.inf)
        context = scores.softmax(-1).to(memory.dtype) @ memory
        combined = torch.tanh(self.combine(torch.cat([outputs, context], -1)))
        return self.output(self.dropout(combined.amax(1))), replace(state, hidden=hidden)


def _select(state: TraceState, rows: Int[Tensor, " batch"]) -> TraceState:
    hidden = state.hidden
    if hidden is not None:
        hidden = select_hidden(hidden, rows, state.told.shape[1])
    return TraceState(state.memory[rows], state.there[rows], state.told[rows], hidden)
