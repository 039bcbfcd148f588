"""How a synthesizer learns from rewards on its own beam, after the likelihood has been learned."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from evaps.dsl import VOCAB
from evaps.models.base import Synthesizer
from evaps.models.beam import beam_search
from evaps.models.compute import autocast, device
from evaps.models.dropout import without_dropout
from evaps.train.batches import batch_at
from evaps.train.lessons import Lessons
from evaps.train.loop import FitConfig, Share, fit
from evaps.train.reinforce import expected_best
from evaps.train.run import Run
from evaps.train.synthesizers import Validation


def train_on_rewards(run: Run, model: Synthesizer, start: str) -> Path:
    """Reinforcement learning on the beam; the model has the weights of ``start`` already.

    A program's reward is +1 if it generalises to all six scenes, -1 if not (Bunel et al., 2018).
    """
    scale = run.scale
    config = FitConfig(
        scale.rl_steps,
        rate=1e-5,  # theirs, too; with ten times that held-out tasks are solved less and less
        seed=run.seed,
        warmup=10,
        validate_every=100,
        patience=scale.patience,
        log_every=10,
    )
    train = run.dataset.split("train")
    alike = [0] * len(train)  # short and long programs together: of long ones alone none may earn anything
    rows_at = batch_at(alike, scale.rl_batch, run.seed + 7)

    def loss_at(step: int, share: Share) -> tuple[Tensor, dict[str, float]]:
        return reward_loss(run, model, [train[i] for i in share.of(rows_at(step))])

    made_from = run.made_from(model, "encoder", start)
    likelihood = Validation(run, model)

    def validate() -> dict[str, float]:
        return {**likelihood(), "best_reward": mean_best_reward(run, model, likelihood.tasks)}

    folder = run.out / model.name
    metrics = fit(
        model, loss_at, config, folder, validate, "best_reward", made_from, run.tensorboard, keep_start=True
    )
    return run.save(model, model.name, config, metrics, made_from)


def mean_best_reward(run: Run, model: Synthesizer, positions: Sequence[int]) -> float:
    """What is trained, on held-out tasks: it jumps less than the share of tasks that some programs solve."""
    size = run.scale.rl_batch
    parts = [positions[start : start + size] for start in range(0, len(positions), size)]
    losses = [reward_loss(run, model, part)[0].item() for part in parts]
    return -float(np.average(losses, weights=[len(part) for part in parts]))


def reward_loss(run: Run, model: Synthesizer, positions: Sequence[int]) -> tuple[Tensor, dict[str, float]]:
    """Minus the expected best reward of a bag of draws from the renormalised beam, a mean over tasks.

    With it the ``reward`` of one draw, and the share of tasks whose beam has a right program (``solvable``):
    the others teach nothing.
    """
    scale = run.scale
    features = run.task_features(positions)
    with without_dropout(model):  # the beam, and what it is worth
        with autocast():
            groups = [[p.program for p in group] for group in beam_search(model, features, scale.rl_beam)]
        bests, means, solvable = [], [], []
        for position, programs, given in zip(positions, groups, features, strict=True):
            if not programs:
                continue
            right = run.judge.generalize(position, programs)
            rewards = torch.from_numpy(np.where(right, 1.0, -1.0)).float().to(device())
            lessons = Lessons.of([VOCAB.encode(p.tokens) for p in programs])
            repeated = given[None].expand(len(programs), *given.shape)
            scores = model.log_probabilities(repeated, *lessons.batch(range(len(programs))))
            bests.append(expected_best(scores, rewards, scale.rl_draws))
            means.append((scores.detach().softmax(-1) * rewards).sum().item())
            solvable.append(right.any())
    metrics = {"reward": float(np.mean(means)), "solvable": float(np.mean(solvable))}
    return -torch.stack(bests).mean(), metrics
