"""EVAPS: repairs a program with what the robot saw around each of its segments.

Chen et al., "Enhancing Robot Program Synthesis Through Environmental Context", NeurIPS 2023. Two parts speak
for every token: partial observation leveraging (Eq. 1-3), what the robot saw before and after the token's
segment, for each pair; and code symbol alignment (Eq. 4-5), a graph network over the program's tokens.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar, Literal

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn import functional as F
from torch_geometric.data import Batch as GraphBatch
from torch_geometric.data import Data
from torch_geometric.nn import GATv2Conv

from evaps.dsl import TOKEN_TYPES, VOCAB, Program, token_type
from evaps.models.base import Execution, Joined, Repairer
from evaps.models.pairs import PairConfig, PairEmbedding
from evaps.models.parallel_edits import SLOTS, ParallelEdits
from evaps.models.recurrent import reversal
from evaps.models.sequential_edits import SequentialEdits

EditMode = Literal["sequential", "parallel", "substitution"]
_TYPES = torch.tensor([TOKEN_TYPES.index(token_type(token)) for token in VOCAB.tokens])


@dataclass(frozen=True)
class EvapsConfig:
    """Sizes and readings; the paper gives no sizes."""

    feature: int = 256
    """Size of an observation's embedding."""
    pair: int = 512
    """Size of a pair's embedding."""
    hidden: int = 256
    """Size of a token's and of a segment's representation."""
    graph_layers: int = 2
    """Layers of GATv2 (Brody et al., 2022)."""
    heads: int = 4
    """Attention heads of GATv2."""
    slope: float = 0.2
    """Of GATv2's leaky ReLU."""
    observations: bool = True
    """Partial observation leveraging (O); off in the ablations Naive and EVAPS+S."""
    graph: bool = True
    """Code symbol alignment (S); off in the ablations Naive and EVAPS+O."""
    goal: bool = True
    """Whether the repairer sees the goal: how it differs from the first, the last and each segment's view."""
    context: bool = True
    """Whether an LSTM in either direction goes over the tokens before the decoder (this project's choice)."""
    edits: EditMode = "sequential"
    """Whether tokens are edited one after the other, as in SED, all at once, or all at once and only by
    substitution, the paper's literal words."""
    dropout: float = 0.2
    """On token representations and on the decoder's output."""
    beam: int = 4
    """Edited left parts kept while decoding."""


@dataclass(frozen=True)
class Batch:
    """Executions as tensors. ``segment`` counts through all programs of the batch."""

    tokens: Int[Tensor, "batch time"]
    real: Bool[Tensor, "batch time"]
    edges: Int[Tensor, "2 edge"]  # over the real tokens of all programs
    segments: Int[Tensor, "batch time"]
    owner: Int[Tensor, " segment"]
    before: Int[Tensor, "segment pair"]
    after: Int[Tensor, "segment pair"]
    first: Int[Tensor, "batch pair"]
    final: Int[Tensor, "batch pair"]
    goal: Int[Tensor, "batch pair"]

    @classmethod
    def of(cls, executions: Sequence[Execution], device: torch.device) -> Batch:
        """Join executions; programs are padded to the longest."""
        programs = [e.program for e in executions]
        joined = Joined.of(programs, device)
        graphs = GraphBatch.from_data_list([_graph(program) for program in programs])
        seen = [np.concatenate([getattr(e, k).T for e in executions]) for k in ("before", "after")]
        ends = [np.stack([getattr(e, k) for e in executions]) for k in ("first", "final", "goal")]
        arrays = [torch.from_numpy(a.astype(np.int64)).to(device) for a in (*seen, *ends)]
        edges = graphs.edge_index.to(device)
        return cls(joined.tokens, joined.tokens > 0, edges, joined.segments, joined.owner, *arrays)


@lru_cache(maxsize=100_000)  # the same ones come up in every epoch
def _graph(program: Program) -> Data:
    """The program's tokens and its edges in both directions, for PyTorch Geometric."""
    edges = np.array(program.edges, np.int64).reshape(-1, 2)
    both = np.concatenate([edges, edges[:, ::-1]]).T
    return Data(edge_index=torch.from_numpy(both.copy()), num_nodes=len(program.tokens))


class Evaps(Repairer):
    """Per token ``x_s = [h'_s | O'_s]`` (Eq. 6), max-pooled over the pairs, and a decoder of edits.

    Before the pool, a bidirectional LSTM goes over the token representations of each pair, unless a flag says
    no (this project's choice). The paper edits all tokens at once; a flag says whether they are edited one
    after the other.
    """

    name = "evaps"
    Config: ClassVar[type] = EvapsConfig

    def __init__(self, config: EvapsConfig = EvapsConfig()) -> None:
        super().__init__()
        self.config = config
        size = config.hidden
        self.pair = PairEmbedding(PairConfig(config.feature, config.pair))
        self.token = nn.Embedding(len(VOCAB), size, padding_idx=0)
        self.token_type = nn.Embedding(len(TOKEN_TYPES), size, padding_idx=0)
        layer = (size, size // config.heads, config.heads)
        graph_layers = config.graph_layers if config.graph else 0
        self.graph = nn.ModuleList(
            GATv2Conv(*layer, negative_slope=config.slope) for _ in range(graph_layers)
        )
        views = (1 + config.goal) * config.pair
        self.segment = nn.Linear(views, size) if config.observations else None
        self.never = nn.Parameter(torch.zeros(size))  # stands for what a segment that never ran saw
        ends = (1 + config.observations) * config.pair
        self.ends = nn.Linear(ends, size) if config.goal else None
        self.mix = nn.Linear((1 + config.observations + config.goal) * size, size)
        if config.context:
            self.onwards = nn.LSTM(size, size // 2, batch_first=True)
            self.backwards = nn.LSTM(size, size // 2, batch_first=True)
        self.dropout = nn.Dropout(config.dropout)
        self.edits: ParallelEdits | SequentialEdits = (
            SequentialEdits(size, size, dropout=config.dropout)
            if config.edits == "sequential"
            else ParallelEdits(size, config.dropout, SLOTS if config.edits == "parallel" else 0)
        )

    def forward(
        self, batch: Batch, table: Float[Tensor, "row feature"]
    ) -> Float[Tensor, "batch time memory"]:
        """For each token what its edits are decided on: ``x_s`` in context, max-pooled over the pairs."""
        x = self.represent(batch, table)
        x = self.dropout(F.relu(self.mix(x)))
        return (self._in_context(x, batch.real) if self.config.context else x).amax(1)

    def _in_context(
        self, x: Float[Tensor, "batch pair time hidden"], real: Bool[Tensor, "batch time"]
    ) -> Float[Tensor, "batch pair time hidden"]:
        """With what a bidirectional LSTM over the tokens of each pair adds."""
        swap = reversal(real).to(x.dtype)[:, None]
        onwards, _ = self.onwards(x.flatten(0, 1))
        backwards, _ = self.backwards((swap @ x).flatten(0, 1))
        backwards = swap.to(backwards.dtype) @ backwards.unflatten(0, x.shape[:2])
        return x + torch.cat([onwards.unflatten(0, x.shape[:2]), backwards], -1)

    def represent(
        self, batch: Batch, table: Float[Tensor, "row feature"]
    ) -> Float[Tensor, "batch pair time part"]:
        """``x_s``: for each pair and token, the graph's, the segment's and the goal's part, side by side."""
        time = batch.tokens.shape[1]
        pairs = batch.goal.shape[1]
        parts = [self._symbols(batch)[:, None].expand(-1, pairs, -1, -1)]
        if self.segment is not None:
            parts.append(self._observations(batch, table)[batch.segments].transpose(1, 2))
        if self.ends is not None:
            parts.append(self._goals(batch, table)[:, :, None].expand(-1, -1, time, -1))
        return torch.cat(parts, -1)

    def _symbols(self, batch: Batch) -> Float[Tensor, "batch time hidden"]:
        """``h'_s``: the tokens' embeddings, passed along the edges of the program's graph (Eq. 4-5)."""
        h = self.token(batch.tokens) + self.token_type(_TYPES.to(batch.tokens.device)[batch.tokens])
        nodes = h[batch.real]
        for layer in self.graph:
            nodes = nodes + F.elu(layer(nodes, batch.edges))
        return torch.zeros_like(h).masked_scatter(batch.real[..., None], nodes.to(h.dtype))

    def _observations(self, batch: Batch, table: Tensor) -> Float[Tensor, "segment pair hidden"]:
        """``O'_s``: what the robot saw before and after each segment (Eq. 1-3), and what the goal lacks."""
        assert self.segment is not None
        before, after = batch.before.clamp(min=0), batch.after.clamp(min=0)
        views = [self.pair.of_rows(table, before, after)]
        if self.config.goal:
            views.append(self.pair.of_rows(table, after, batch.goal[batch.owner]))
        seen = F.relu(self.segment(F.relu(torch.cat(views, -1))))
        return torch.where((batch.before < 0)[..., None], self.never.to(seen.dtype), seen)

    def _goals(self, batch: Batch, table: Tensor) -> Float[Tensor, "batch pair hidden"]:
        """What was to be done from the first view, and what is left to do at the end of the run."""
        assert self.ends is not None
        views = [self.pair.of_rows(table, batch.first, batch.goal)]
        if self.config.observations:
            views.append(self.pair.of_rows(table, batch.final, batch.goal))
        return F.relu(self.ends(F.relu(torch.cat(views, -1))))

    def batch(
        self, executions: Sequence[Execution], targets: Sequence[Program], device: torch.device
    ) -> tuple[Batch, Any]:
        """See `Repairer.batch`."""
        programs = [e.program for e in executions]
        return Batch.of(executions, device), self.edits.targets(programs, targets, device)

    def batch_loss(self, batch: tuple[Batch, Any], table: Float[Tensor, "row feature"]) -> Float[Tensor, ""]:
        """Cross-entropy of the Levenshtein edits, a mean over a program's edits, then over programs."""
        return self.edits.loss(self(batch[0], table)[:, None], batch[1])  # pooled over the pairs already

    @torch.inference_mode()
    def repairs(
        self, executions: Sequence[Execution], table: Float[Tensor, "row feature"], beam: int
    ) -> list[Iterator[Program]]:
        """See `Repairer.repairs`."""
        memory = self(Batch.of(executions, table.device), table)[:, None]
        return self.edits.decode(memory, [e.program for e in executions], beam)
