"""Embeddings of pairs of observations."""

import pytest
import torch

from evaps.models.pairs import PairConfig, PairEmbedding


def test_pairs_of_rows_are_embedded_once_with_the_same_values_and_gradients() -> None:
    torch.manual_seed(0)
    net = PairEmbedding(PairConfig(feature=8, pair=6)).double()
    given: list[int] = []
    net.layers.register_forward_pre_hook(lambda _, inputs: given.append(len(inputs[0])))
    table = torch.randn(4, 8, dtype=torch.float64)
    before, after = torch.tensor([[0, 1, 1], [3, 1, 0]]), torch.tensor([[2, 3, 3], [1, 3, 2]])
    found, weights = net.of_rows(table, before, after), torch.randn(2, 3, 6, dtype=torch.float64)
    assert given == [3], "(0, 2), (1, 3) and (3, 1)"
    expected = net(table[before], table[after])
    torch.testing.assert_close(found, expected)
    gradients = [torch.autograd.grad((e * weights).sum(), net.parameters()) for e in (found, expected)]
    for one, other in zip(*gradients, strict=True):
        torch.testing.assert_close(one, other)
    assert any(bool(one.any()) for one in gradients[0])


def test_the_order_within_a_pair_matters() -> None:
    torch.manual_seed(0)
    net = PairEmbedding(PairConfig(feature=8, pair=6))
    table, rows = torch.randn(2, 8), torch.tensor([0, 1])
    one, other = net.of_rows(table, rows, rows.flip(0))
    with pytest.raises(AssertionError):
        torch.testing.assert_close(one, other)
