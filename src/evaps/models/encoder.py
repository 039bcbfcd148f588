"""The observation encoder that all methods share, and what it learns from first (stage 0)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor, nn
from torch.nn import functional as F

from evaps.models.pairs import PairConfig, PairEmbedding


@dataclass(frozen=True)
class EncoderConfig:
    """Sizes of the encoder; the channels are those of Sun et al. (2018), the rest is our choice."""

    channels: tuple[int, ...] = (16, 32, 48, 48, 48)
    """Of the 3x3 convolutions with stride 2."""
    feature: int = 256
    """Size of an observation's embedding."""
    pair: int = 512
    """Size of the embedding of a pair of observations."""
    height: int = 120
    """Of an observation, in pixels."""
    width: int = 160
    """Of an observation, in pixels."""
    actions: int = 7
    """How many actions the robot has (stage 0 only)."""
    perceptions: int = 6
    """How many perceptions the robot has (stage 0 only)."""
    longest: int = 8
    """The longest walk whose actions stage 0 counts."""


class Encoder(nn.Module):
    """Embeds observations: ``f(O)`` (Eq. 1), five convolutions and a linear layer.

    Batch normalisation behind each convolution is this project's choice: without it stage 0 stays on a
    plateau for some 600 batches; with it the loss falls in 350 batches as far as in 1,500 without.

    Args:
        config: sizes.
    """

    def __init__(self, config: EncoderConfig) -> None:
        super().__init__()
        self.config = config
        channels = (4, *config.channels)
        layers: list[nn.Module] = []
        for before, after in pairwise(channels):
            convolution = nn.Conv2d(before, after, 3, stride=2, padding=1, bias=False)
            layers += [convolution, nn.BatchNorm2d(after), nn.ReLU()]
        self.convolutions = nn.Sequential(*layers)
        height, width = config.height, config.width
        for _ in config.channels:
            height, width = -(-height // 2), -(-width // 2)
        self.linear = nn.Linear(channels[-1] * height * width, config.feature)

    def forward(self, frames: UInt8[Tensor, "batch height width 4"]) -> Float[Tensor, "batch feature"]:
        """Embed RGB and depth, bytes in ``[0, 255]``, scaled to ``[0, 1]``."""
        scaled = frames.permute(0, 3, 1, 2).to(self._dtype()) / 255  # channels last in memory
        return self.linear(self.convolutions(scaled).flatten(1))

    def _dtype(self) -> torch.dtype:
        kind = self.linear.weight.device.type
        return torch.get_autocast_dtype(kind) if torch.is_autocast_enabled(kind) else self.linear.weight.dtype


@dataclass(frozen=True)
class Transitions:
    """What stage 0 learns from: pairs of observations on walks, and what happened between them.

    Attributes:
        before: row of the earlier observation.
        after: row of the later one.
        counts: how often each action was executed in between.
        first: the first action in between.
        last: the last action in between.
        change: forward and left displacement (hundreds of map units, in the robot's first frame), sine and
            cosine of the turn, bullets spent.
    """

    before: Int[Tensor, " pair"]
    after: Int[Tensor, " pair"]
    counts: Int[Tensor, "pair action"]
    first: Int[Tensor, " pair"]
    last: Int[Tensor, " pair"]
    change: Float[Tensor, "pair 5"]

    def to(self, device: torch.device) -> Transitions:
        """The same on a device."""
        return Transitions(*(value.to(device) for value in vars(self).values()))


class TransitionModel(nn.Module):
    """Stage 0: learn an embedding space of the environment from what actions do to observations.

    The paper learns one "first" without saying how; predicting the actions between two observations, the
    change of pose and the robot's own perceptions is this project's reading.
    """

    def __init__(self, config: EncoderConfig) -> None:
        super().__init__()
        self.config = config
        self.encoder = Encoder(config)
        self.pair = PairEmbedding(PairConfig(config.feature, config.pair))
        self.perceptions = nn.Linear(config.feature, config.perceptions)
        self.counts = nn.Linear(config.pair, config.actions * (config.longest + 1))
        self.ends = nn.Linear(config.pair, 2 * config.actions)
        self.change = nn.Linear(config.pair, 5)

    def loss(
        self,
        frames: UInt8[Tensor, "batch height width 4"],
        perceived: Bool[Tensor, "batch perception"],
        transitions: Transitions,
    ) -> tuple[Float[Tensor, ""], dict[str, float]]:
        """The sum of the four losses, and the shares that are predicted right."""
        embedded = self.encoder(frames)
        pair = self.pair(embedded[transitions.before], embedded[transitions.after])
        perceptions = self.perceptions(embedded).float()
        counts = self.counts(pair).float().unflatten(-1, (self.config.actions, -1))
        first, last = self.ends(pair).float().chunk(2, -1)
        change = self.change(pair).float()
        loss = (
            F.binary_cross_entropy_with_logits(perceptions, perceived.float())
            + F.cross_entropy(counts.flatten(0, 1), transitions.counts.flatten())
            + 0.5 * (F.cross_entropy(first, transitions.first) + F.cross_entropy(last, transitions.last))
            + F.smooth_l1_loss(change, transitions.change)
        )
        metrics = {
            "perceptions": ((perceptions > 0) == perceived).float().mean().item(),
            "counts": (counts.argmax(-1) == transitions.counts).all(-1).float().mean().item(),
            "first": (first.argmax(-1) == transitions.first).float().mean().item(),
        }
        return loss, metrics
