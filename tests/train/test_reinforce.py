"""Rewards on a beam: against sums over all draws, and gradients against finite differences."""

from itertools import product

import pytest
import torch

from evaps.train.reinforce import expected_best

REWARDS = torch.tensor([1.0, -1.0, -1.0, 1.0, 0.5], dtype=torch.float64)
SCORES = torch.tensor([-3.0, -1.0, -2.5, -4.0, -2.0], dtype=torch.float64)


def test_one_draw_is_the_expectation() -> None:
    by_hand = (SCORES.exp() / SCORES.exp().sum() * REWARDS).sum()
    torch.testing.assert_close(expected_best(SCORES, REWARDS, 1), by_hand)


@pytest.mark.parametrize("draws", [2, 3])
def test_a_bag_is_the_mean_over_all_bags(draws: int) -> None:
    shares = SCORES.softmax(0)
    bags = product(range(5), repeat=draws)
    by_hand = sum(shares[list(bag)].prod() * REWARDS[list(bag)].max() for bag in bags)
    torch.testing.assert_close(expected_best(SCORES, REWARDS, draws), by_hand)


def test_batches_are_rows() -> None:
    scores, rewards = torch.stack([SCORES, SCORES.flip(0)]), torch.stack([REWARDS, -REWARDS])
    together = expected_best(scores, rewards, 3)
    each = [expected_best(s, r, 3) for s, r in zip(scores, rewards, strict=True)]
    torch.testing.assert_close(together, torch.stack(each))


@pytest.mark.parametrize("draws", [1, 3])
def test_gradients_agree_with_finite_differences(draws: int) -> None:
    scores = SCORES.clone().requires_grad_()
    assert torch.autograd.gradcheck(lambda s: expected_best(s, REWARDS, draws), scores)


def test_a_bag_leaves_room_for_diversity() -> None:
    """With two right programs of three, it matters less to a bag which of them is drawn."""
    rewards = torch.tensor([1.0, 1.0, -1.0], dtype=torch.float64)
    scores = torch.tensor([0.0, -3.0, -3.0], dtype=torch.float64, requires_grad=True)
    (one,) = torch.autograd.grad(expected_best(scores, rewards, 1), scores)
    (bag,) = torch.autograd.grad(expected_best(scores, rewards, 5), scores)
    assert one[0] > 10 * bag[0] > 0
