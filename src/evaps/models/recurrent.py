"""What the methods' LSTMs have in common: reading in both directions, and states with a row for each pair."""

from __future__ import annotations

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn import functional as F


def reversal(real: Bool[Tensor, "batch time"]) -> Float[Tensor, "batch time time"]:
    """Matrices that put each row's real tokens into the opposite order, and leave its padding behind them."""
    time = torch.arange(real.shape[1], device=real.device)
    opposite = torch.where(real, real.sum(1, keepdim=True) - 1 - time, time)
    return F.one_hot(opposite, real.shape[1]).float()


def select_hidden(
    hidden: tuple[Tensor, Tensor], rows: Int[Tensor, " batch"], pairs: int
) -> tuple[Tensor, Tensor]:
    """The state ``[layer, batch * pair, hidden]`` of the chosen rows, with all the pairs of each."""
    flat = (rows[:, None] * pairs + torch.arange(pairs, device=rows.device)).flatten()
    return hidden[0][:, flat], hidden[1][:, flat]


class BothWays(nn.Module):
    """A bidirectional LSTM over rows of different lengths, without packing, which is slow on processors.

    Args:
        size: of what is read, and of what comes out: half from each direction.
        layers: each reads what the one before it wrote, in both directions.
        dropout: between the layers.
    """

    def __init__(self, size: int, layers: int, dropout: float) -> None:
        super().__init__()
        half = (size, size // 2)
        self.onwards = nn.ModuleList(nn.LSTM(*half, batch_first=True) for _ in range(layers))
        self.backwards = nn.ModuleList(nn.LSTM(*half, batch_first=True) for _ in range(layers))
        self.dropout = nn.Dropout(dropout)

    def forward(
        self, x: Float[Tensor, "batch time size"], real: Bool[Tensor, "batch time"]
    ) -> Float[Tensor, "batch time size"]:
        """What stands at each token, knowing what stands before and behind it.

        Args:
            x: rows, padded at their ends.
            real: which of it is no padding.
        """
        swap = reversal(real).to(x.dtype)
        for onwards, backwards in zip(self.onwards, self.backwards, strict=True):
            ahead, _ = onwards(x)
            back, _ = backwards(swap @ x)
            x = self.dropout(torch.cat([ahead, swap.to(back.dtype) @ back], -1))
        return x
