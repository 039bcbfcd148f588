"""The LSTMs that are written out are PyTorch's; that which is told of pairs, with all side by side."""

import torch
from torch import Tensor, nn

from evaps.models.recurrent import PairLSTM, one_step

BATCH, PAIRS, TIME, TOKEN, PAIR, HIDDEN = 3, 5, 7, 6, 8, 4


def network() -> tuple[PairLSTM, Tensor, Tensor]:
    torch.manual_seed(0)
    token = torch.randn(BATCH, TIME, TOKEN, dtype=torch.float64, requires_grad=True)
    pair = torch.randn(BATCH, PAIRS, PAIR, dtype=torch.float64, requires_grad=True)
    return PairLSTM(TOKEN, PAIR, HIDDEN, layers=2).double(), token, pair


def side_by_side(net: PairLSTM, token: Tensor, pair: Tensor) -> tuple[Tensor, tuple[Tensor, Tensor]]:
    both = [token[:, None].expand(-1, PAIRS, -1, -1), pair[:, :, None].expand(-1, -1, TIME, -1)]
    outputs, state = nn.LSTM.forward(net, torch.cat(both, -1).flatten(0, 1))
    return outputs, state


def test_outputs_states_and_gradients_are_those_of_an_lstm() -> None:
    net, token, pair = network()
    known = [token, pair, *net.parameters()]
    results = []
    for outputs, state in (net(token, net.told(pair)), side_by_side(net, token, pair)):
        gradients = torch.autograd.grad(outputs.square().mean() + state[1].mean(), known)
        results.append([outputs, *state, *gradients])
    # the cells are computed in float32
    torch.testing.assert_close(*results, rtol=1e-5, atol=1e-6, check_dtype=False)


def test_a_token_at_a_time_ends_where_all_at_once_do() -> None:
    net, token, pair = network()
    told, state = net.told(pair), None
    for at in range(TIME):
        output, state = net(token[:, at : at + 1], told, state)
    outputs, whole = net(token, told)
    torch.testing.assert_close(output[:, 0], outputs[:, -1])
    torch.testing.assert_close(state, whole)


def test_one_token_at_a_time_is_the_same_as_all_at_once() -> None:
    torch.manual_seed(2)
    whole = nn.LSTM(TOKEN, HIDDEN, 2)
    x = torch.randn(4, 3, TOKEN)
    expected, last = whole(x)
    hidden, outputs = (torch.zeros(2, 3, HIDDEN), torch.zeros(2, 3, HIDDEN)), []
    for token in x:
        output, hidden = one_step(whole, token, hidden)
        outputs.append(output)
    torch.testing.assert_close(torch.stack(outputs), expected)
    torch.testing.assert_close(hidden, last)
