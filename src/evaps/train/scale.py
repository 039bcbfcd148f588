"""The one dial: how much data and training each scale has."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Scale:
    """How much data and training."""

    tasks: int
    """Tasks in the data set, all splits together."""
    walks: int
    """Random walks for the encoder."""
    task_walks: int
    """Walks for the encoder that start as a training program did."""
    encoder_steps: int
    """Batches for the encoder."""
    encoder_batch: int
    """Walks in one of them; each has 9 frames and 36 pairs of them."""
    lgrl_steps: int
    """Batches for LGRL."""
    lgrl_batch: int
    """Tasks in one of them."""
    mistake_tasks: int
    """Training tasks that the repairer sees mistakes on."""
    mutations: int
    """Mutated programs a task (stage 1)."""
    failures: int
    """Failed programs of the synthesizer a task (stage 2)."""
    evaps_steps: tuple[int, int]
    """Batches for EVAPS in stage 1 and in stage 2."""
    evaps_batch: int
    """Wrong programs in one of them."""


SCALES = {
    "smoke": Scale(40, 500, 0, 4, 8, 8, 8, 10, 1, 2, (4, 4), 8),
    "small": Scale(20_000, 22_000, 8_000, 7_500, 16, 2_000, 128, 10_000, 1, 2, (300, 1_800), 64),
    "paper": Scale(100_000, 100_000, 40_000, 40_000, 16, 30_000, 128, 70_000, 2, 3, (10_000, 20_000), 64),
}
