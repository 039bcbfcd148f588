"""Rewards on a beam: Bunel et al., "Leveraging Grammar and Reinforcement Learning", ICLR 2018, section 4.

The beam's programs are taken for all that there are, their probabilities renormalised, so that the expected
reward and its gradient are sums and need no samples.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor


def expected_best(
    log_probabilities: Float[Tensor, "*batch candidate"],
    rewards: Float[Tensor, "*batch candidate"],
    draws: int,
) -> Float[Tensor, "*batch"]:
    """The expected largest reward of a bag of so many draws: it asks for diversity (their equation 10).

    With one draw it is the expected reward (their equation 8).

    P(max <= r) is P(one draw <= r) to the power of ``draws``; candidates of equal reward share what their
    reward adds to that.
    """
    probabilities = log_probabilities.softmax(-1)
    levels = rewards.unique()  # ascending; few
    best = torch.zeros_like(probabilities[..., 0])
    below = torch.zeros_like(best)
    for level in levels:
        up_to = ((rewards <= level) * probabilities).sum(-1).clamp(max=1.0) ** draws
        best = best + level * (up_to - below)
        below = up_to
    return best
