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


def one_step(
    lstm: nn.LSTM, x: Float[Tensor, "row size"], hidden: tuple[Tensor, Tensor]
) -> tuple[Float[Tensor, "row hidden"], tuple[Tensor, Tensor]]:
    """The top layer's output, and the state ``[layer, row, hidden]``, after a single token.

    For what is read token by token, since what comes next depends on what was said. On a processor PyTorch's
    LSTM puts its weights into another order at every call, which takes longer than the step; this writes the
    step out. On a graphics card it is cuDNN's.
    """
    if x.is_cuda:
        outputs, hidden = lstm(x[:, None] if lstm.batch_first else x[None], hidden)
        return outputs.flatten(0, 1), hidden
    states = []
    for (into, onwards, a, b), before, cell in zip(lstm.all_weights, *hidden, strict=True):
        x, cell = next_state(F.linear(x, into, a) + F.linear(before, onwards, b), cell)
        states.append((x, cell))
    hiddens, cells = zip(*states, strict=True)
    return x, (torch.stack(hiddens), torch.stack(cells))


class PairLSTM(nn.LSTM):
    """An LSTM over tokens, a row for each pair of a program, which is told of that pair at every token.

    All pairs of a program have its tokens in common, and a pair stays the same from token to token. On a
    processor, each is multiplied with the LSTM's weights once, instead of once for every pair and token: half
    of the arithmetic, and the same numbers but for rounding. On a graphics card, where the steps' small
    kernels would cost more than that saves, they are put side by side for cuDNN.

    Args:
        token: size of a token's embedding.
        pair: size of a pair's.
        hidden: size of the state.
        layers: each reads the one before it.
    """

    def __init__(self, token: int, pair: int, hidden: int, layers: int) -> None:
        super().__init__(token + pair, hidden, layers, batch_first=True)
        self.token = token

    def told(self, pair: Float[Tensor, "batch pair size"]) -> Float[Tensor, "batch pair told"]:
        """What `forward` wants to know of the pairs."""
        return pair if pair.is_cuda else F.linear(pair, self.all_weights[0][0][:, self.token :])

    def forward(  # type: ignore[override]
        self,
        token: Float[Tensor, "batch time token"],
        told: Float[Tensor, "batch pair told"],
        hidden: tuple[Tensor, Tensor] | None = None,
    ) -> tuple[Float[Tensor, "batch_pair time hidden"], tuple[Tensor, Tensor]]:
        """The top layer's outputs, and the state ``[layer, batch * pair, hidden]`` after the last token."""
        pairs, time = told.shape[1], token.shape[1]
        if token.is_cuda:
            both = token[:, None].expand(-1, pairs, -1, -1), told[:, :, None].expand(-1, -1, time, -1)
            return super().forward(torch.cat(both, -1).flatten(0, 1), hidden)
        if hidden is None:
            zeros = token.new_zeros(self.num_layers, len(token) * pairs, self.hidden_size)
            hidden = zeros, zeros
        states = list(zip(*hidden, strict=True))
        weights = [(into, onwards, a + b) for into, onwards, a, b in self.all_weights]
        shared = F.linear(token, weights[0][0][:, : self.token], weights[0][2])
        gates = (shared[:, None] + told[:, :, None]).flatten(0, 1)
        for layer, (_, onwards, _) in enumerate(weights):
            outputs, states[layer] = _over_time(gates, onwards, states[layer])
            if layer + 1 < self.num_layers:
                into, _, bias = weights[layer + 1]
                gates = F.linear(outputs, into, bias)
        hiddens, cells = zip(*states, strict=True)
        return outputs, (torch.stack(hiddens), torch.stack(cells))


def _over_time(
    gates: Float[Tensor, "row time gate"], onwards: Float[Tensor, "gate hidden"], state: tuple[Tensor, Tensor]
) -> tuple[Float[Tensor, "row time hidden"], tuple[Tensor, Tensor]]:
    """One layer: its outputs, and its state at the end, from what comes in, multiplied already."""
    hidden, cell = state
    outputs = []
    for coming in gates.unbind(1):
        hidden, cell = next_state(coming + F.linear(hidden, onwards), cell)
        outputs.append(hidden)
    return torch.stack(outputs, 1), (hidden, cell)


def next_state(
    gates: Float[Tensor, "*row gate"], cell: Float[Tensor, "*row hidden"]
) -> tuple[Float[Tensor, "*row hidden"], Float[Tensor, "*row hidden"]]:
    """An LSTM's equations, with PyTorch's order of the gates, in float32: the next hidden state and cell."""
    into, forget, new, out = gates.float().chunk(4, -1)
    cell = forget.sigmoid() * cell + into.sigmoid() * new.tanh()
    return out.sigmoid() * cell.tanh(), cell


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
