"""How a synthesizer learns from rewards on its own beam, after the likelihood has been learned."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from evaps.dsl import VOCAB, UserError
from evaps.models.base import Synthesizer
from evaps.models.beam import beam_search
from evaps.models.compute import autocast
from evaps.models.dropout import without_dropout
from evaps.tasks.task import EXAMPLES
from evaps.train.batches import batch_at, rotating_pairs
from evaps.train.lessons import Lessons
from evaps.train.loop import START_ANEW, FitConfig, Share, fit
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
        rate=1e-5,  # as theirs
        seed=run.seed,
        warmup=10,
        validate_every=100,
        log_every=10,
    )
    train = run.dataset.split("train")
    alike = [0] * len(train)  # short and long programs together: of long ones alone none may earn anything
    rows_at = batch_at(alike, scale.rl_batch, run.seed + 7)

    def loss_at(step: int, share: Share) -> tuple[Tensor, dict[str, float]]:
        rows = share.of(rows_at(step))
        rng = np.random.default_rng([run.seed, 4, step, share.index])
        return reward_loss(run, model, [train[i] for i in rows], rotating_pairs(len(rows), rng))

    made_from = run.made_from(model, ("rl_batch", "rl_beam", "rl_draws"), "encoder", start)
    validation = Validation(run, model)

    def validate() -> dict[str, float]:
        return {**validation(), "best_reward": mean_best_reward(run, model, validation.tasks)}

    folder = run.out / model.name
    metrics = fit(
        model, loss_at, config, folder, validate, "score", made_from, run.tensorboard, keep_start=True
    )
    return run.save(model, model.name, config, metrics, made_from)


def mean_best_reward(run: Run, model: Synthesizer, positions: Sequence[int]) -> float:
    """What is trained, on held-out tasks."""
    size = run.scale.rl_batch
    parts = [positions[start : start + size] for start in range(0, len(positions), size)]
    losses = [reward_loss(run, model, part)[0].item() for part in parts]
    return -float(np.average(losses, weights=[len(part) for part in parts]))


def reward_loss(
    run: Run, model: Synthesizer, positions: Sequence[int], pairs: Any = slice(EXAMPLES)
) -> tuple[Tensor, dict[str, float]]:
    """Minus the expected best reward of a bag of draws from the renormalised beam, a mean over tasks.

    With it the ``reward`` of one draw, and the share of tasks whose beam has a right program (``solvable``):
    the others teach nothing.

    Args:
        run: the training.
        model: learns; its dropout is off.
        positions: of the tasks.
        pairs: which of their examples it is told, as in `Run.task_features`.
    """
    scale = run.scale
    given = run.task_features(positions, pairs)
    with without_dropout(model), autocast():  # the beam, and what it is worth
        beams = [[p.program for p in beam] for beam in beam_search(model, given, scale.rl_beam)]
        right = [run.judge.generalize(p, beam) for p, beam in zip(positions, beams, strict=True)]
        if not any(beams):
            raise UserError(
                f"{run.out / model.name} has diverged: {model.name} proposes nothing any more; {START_ANEW}"
            )
        lessons = Lessons.of([VOCAB.encode(program.tokens) for beam in beams for program in beam])
        owner = torch.repeat_interleave(torch.tensor([len(beam) for beam in beams]))
        scores = model.log_probabilities(given[owner], *lessons.batch(range(len(owner))))
    bests, means = [], []
    for score, verdicts in zip(scores.float().split([len(beam) for beam in beams]), right, strict=True):
        if not len(score):  # nothing was proposed: no number in the logits
            bests.append(score.new_tensor(-1.0))
            means.append(-1.0)
            continue
        rewards = torch.from_numpy(np.where(verdicts, 1.0, -1.0)).to(score)
        bests.append(expected_best(score, rewards, scale.rl_draws))
        means.append((score.detach().softmax(-1) * rewards).sum().item())
    metrics = {"reward": float(np.mean(means)), "solvable": float(np.mean([v.any() for v in right]))}
    return -torch.stack(bests).mean(), metrics
