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
    tuning_steps: int
    """Further batches in which it learns together with a synthesizer; 0: it is frozen at once."""
    inverse_steps: int
    """Batches for the inverse model."""
    synthesizer_steps: int
    """Batches for a synthesizer."""
    synthesizer_batch: int
    """Tasks in one of them."""
    rl_steps: int
    """Batches of reinforcement learning."""
    rl_batch: int
    """Tasks in one of them."""
    rl_beam: int
    """Programs of each of these that are run."""
    rl_draws: int
    """Draws in a bag, of which the best counts."""
    policy_tasks: int
    """Training tasks whose gold programs Inferred Trace's policy learns from."""
    policy_steps: int
    """Batches for it."""
    retrained_tasks: int
    """Training tasks on which Latent Execution may find targets of its own."""
    patience: int
    """Validations without an improvement after which a training stops."""
    mistake_tasks: int
    """Training tasks that the repairer sees mistakes on."""
    mutations: int
    """Mutated programs a task (stage 1)."""
    failures: int
    """Failed programs of the synthesizer a task (stage 2)."""
    repairer_steps: tuple[int, int]
    """Batches for a repairer in stage 1 and in stage 2."""
    repairer_batch: int
    """Wrong programs in one of them."""


SCALES = {
    "smoke": Scale(
        tasks=40,
        walks=100,
        task_walks=0,
        encoder_steps=4,
        encoder_batch=8,
        tuning_steps=2,
        inverse_steps=4,
        synthesizer_steps=8,
        synthesizer_batch=8,
        rl_steps=3,
        rl_batch=4,
        rl_beam=4,
        rl_draws=2,
        policy_tasks=20,
        policy_steps=6,
        retrained_tasks=20,
        patience=5,
        mistake_tasks=10,
        mutations=1,
        failures=2,
        repairer_steps=(4, 4),
        repairer_batch=8,
    ),
    "quick": Scale(
        tasks=3_000,
        walks=3_000,
        task_walks=1_000,
        encoder_steps=1_200,
        encoder_batch=16,
        tuning_steps=0,
        inverse_steps=2_000,
        synthesizer_steps=800,
        synthesizer_batch=32,
        rl_steps=50,
        rl_batch=16,
        rl_beam=16,
        rl_draws=5,
        policy_tasks=1_000,
        policy_steps=500,
        retrained_tasks=1_000,
        patience=5,
        mistake_tasks=1_000,
        mutations=1,
        failures=2,
        repairer_steps=(100, 400),
        repairer_batch=32,
    ),
    "small": Scale(
        tasks=20_000,
        walks=22_000,
        task_walks=8_000,
        encoder_steps=7_500,
        encoder_batch=16,
        tuning_steps=0,
        inverse_steps=8_000,
        synthesizer_steps=4_000,
        synthesizer_batch=32,
        rl_steps=400,
        rl_batch=16,
        rl_beam=16,
        rl_draws=5,
        policy_tasks=4_000,
        policy_steps=2_000,
        retrained_tasks=4_000,
        patience=5,
        mistake_tasks=6_000,
        mutations=1,
        failures=2,
        repairer_steps=(400, 1_600),
        repairer_batch=32,
    ),
    # Seven epochs for synthesizers, as the best weights at small have; five for repairers, as there.
    "paper": Scale(
        tasks=100_000,
        walks=100_000,
        task_walks=40_000,
        encoder_steps=20_000,
        encoder_batch=16,
        tuning_steps=4_000,
        inverse_steps=20_000,
        synthesizer_steps=4_000,
        synthesizer_batch=128,
        rl_steps=1_000,
        rl_batch=16,
        rl_beam=32,
        rl_draws=5,
        policy_tasks=70_000,
        policy_steps=10_000,
        retrained_tasks=20_000,
        patience=10,
        mistake_tasks=10_000,
        mutations=1,
        failures=2,
        repairer_steps=(400, 1_600),
        repairer_batch=64,
    ),
}
