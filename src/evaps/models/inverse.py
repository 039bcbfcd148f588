"""The inverse model: what is left to do between what the robot sees and what it should see.

It knows nothing of programs. From two observations it says how much is left on each axis of the domain,
such as how far the robot still has to turn, to go ahead and to go sideways, as distributions over signed
numbers of actions. An estimate of how many actions are left guides the search for traces
(`evaps.synthesis.traces`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn import functional as F

from evaps.domain import CHOSEN
from evaps.models.pairs import PairConfig, PairEmbedding

AXES = CHOSEN.axes
"""What is counted."""


@dataclass(frozen=True)
class InverseConfig:
    """Sizes; all are this project's choice."""

    feature: int = 256
    """Size of an observation's embedding."""
    pair: int = 512
    """Size of the embedding of two observations, from which the counts are read."""
    most: int = 8
    """The largest number of actions on an axis that is told apart."""


class InverseModel(nn.Module):
    """Two observations in, a distribution over signed counts for each of ``AXES`` out.

    Args:
        config: sizes.
    """

    name = "inverse"
    Config = InverseConfig

    def __init__(self, config: InverseConfig = InverseConfig()) -> None:
        super().__init__()
        self.config = config
        self.pair = PairEmbedding(PairConfig(config.feature, config.pair))
        self.counts = nn.Linear(config.pair, len(AXES) * (2 * config.most + 1))

    def forward(
        self, before: Float[Tensor, "batch feature"], after: Float[Tensor, "batch feature"]
    ) -> Float[Tensor, "batch axis count"]:
        """Logits of the counts ``-most`` to ``most`` on each axis."""
        return self.counts(self.pair(before, after)).unflatten(-1, (len(AXES), -1))

    def loss(
        self,
        before: Float[Tensor, "batch feature"],
        after: Float[Tensor, "batch feature"],
        counts: Int[Tensor, "batch axis"],
    ) -> Float[Tensor, ""]:
        """Cross-entropy of the true counts, a sum over the axes."""
        most = self.config.most
        wanted = counts.clamp(-most, most) + most
        return len(AXES) * F.cross_entropy(self(before, after).float().flatten(0, 1), wanted.flatten())

    @torch.inference_mode()
    def left(
        self,
        before: Float[Tensor, "batch feature"],
        after: Float[Tensor, "batch feature"],
        actions: Sequence[str],
    ) -> tuple[Float[Tensor, " batch"], Float[Tensor, "batch action"]]:
        """How many actions are left, and how many will be left after each action: expectations of |count|."""
        shares = self(before, after).float().softmax(-1)
        counts = torch.arange(-self.config.most, self.config.most + 1, device=shares.device)
        now = (shares * counts.abs()).sum(-1)
        total = now.sum(-1)
        after_each = []
        for action in actions:
            axis, step = effect(action)
            moved = (shares[:, axis] * (counts - step).abs()).sum(-1)
            after_each.append(total - now[:, axis] + moved)
        return total, torch.stack(after_each, 1)

    @torch.inference_mode()
    def log_shares(
        self, before: Float[Tensor, "batch feature"], after: Float[Tensor, "batch feature"]
    ) -> Float[Tensor, "batch axis count"]:
        """Logarithms of the probabilities of the counts."""
        return self(before, after).float().log_softmax(-1)


def effect(action: str) -> tuple[int, int]:
    """The axis that an action counts on, and in which direction."""
    for index, axis in enumerate(AXES):
        if action in (axis.onwards, axis.back):
            return index, 1 if action == axis.onwards else -1
    raise KeyError(action)
