"""The embedding of two observations: what must have happened in between.

It has the shape of the inverse model's hidden layers, and every method starts from the inverse model's
weights: random walks show far more pairs of observations than there are tasks.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn import functional as F


@dataclass(frozen=True)
class PairConfig:
    """Sizes of the embedding of a pair."""

    feature: int = 256
    """Size of an observation's embedding."""
    pair: int = 512
    """Size of the embedding of a pair of observations."""


class PairEmbedding(nn.Module):
    """Embeds two observations, such as a first and a last one, and their difference, in three layers.

    Args:
        config: sizes.
    """

    def __init__(self, config: PairConfig = PairConfig()) -> None:
        super().__init__()
        self.config = config
        sizes = (3 * config.feature, 3 * config.feature, 2 * config.feature, config.pair)
        layers = [layer for a, b in pairwise(sizes) for layer in (nn.Linear(a, b), nn.ReLU())]
        self.layers = nn.Sequential(*layers)

    def forward(
        self, before: Float[Tensor, "*batch feature"], after: Float[Tensor, "*batch feature"]
    ) -> Float[Tensor, "*batch pair"]:
        """The embedding of each pair; no number in it is negative."""
        return self.layers(torch.cat([before, after, after - before], -1))

    def of_rows(
        self,
        table: Float[Tensor, "row feature"],
        before: Int[Tensor, "*batch"],
        after: Int[Tensor, "*batch"],
    ) -> Float[Tensor, "*batch pair"]:
        """The embedding of each pair of a table's rows; one that comes several times is computed once.

        What the robot saw around a statement is often what it saw around the block that it stands in, and
        several candidates do the same: some 40 % of a batch of executions are repetitions.
        """
        pairs, which = torch.unique(before * len(table) + after, return_inverse=True)
        embedded = self(table[pairs // len(table)], table[pairs % len(table)])
        return F.embedding(which, embedded)  # its gradient is quicker than that of indexing


def start_pairs(model: nn.Module, weights: Mapping[str, Tensor]) -> None:
    """Give every embedding of pairs in a model the weights of another one that has learned."""
    for module in model.modules():
        if isinstance(module, PairEmbedding):
            module.load_state_dict(weights)
