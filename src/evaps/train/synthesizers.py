"""What synthesizers learn from: the gold programs, and then the rewards of their own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from evaps.dsl import VOCAB, GrammarState, Program
from evaps.dsl.sampler import MAX_TOKENS
from evaps.models.base import Synthesizer, pad
from evaps.models.beam import beam_search
from evaps.models.compute import autocast, device
from evaps.tasks.progress import track
from evaps.tasks.task import EXAMPLES
from evaps.train.batches import batch_at
from evaps.train.loop import FitConfig, Share, fit
from evaps.train.reinforce import expected_best
from evaps.train.run import Run

VALIDATION_TASKS = 512
VALIDATION_BEAM = 4
Lesson = tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]
"""A program's tokens, and for each of them what the grammar allowed there, ``[token, vocab]``."""


def train_synthesizer(run: Run, model: Synthesizer) -> Path:
    """Maximum likelihood, and, if the method asks for it, a second round on targets of its own."""
    run.start_from_pairs(model)
    config = FitConfig(run.scale.lgrl_steps, rate=1e-3, seed=run.seed, patience=run.scale.patience)
    made_from = run.made_from(model, "encoder", "pair")
    train = run.dataset.split("train")
    lessons = {p: lesson(run.programs[p]) for p in train}
    metrics = _fit_likelihood(run, model, lessons, config, run.out / model.name, made_from)
    if model.retrains:
        lessons |= _own_targets(run, model, train[: run.scale.retrained_tasks])
        again = FitConfig(config.steps // 2, rate=3e-4, seed=run.seed + 1, patience=config.patience)
        folder = run.out / model.name / "retrained"
        metrics = _fit_likelihood(run, model, lessons, again, folder, {**made_from, "first": metrics})
    return run.save(model, model.name, config, metrics)


def lesson(tokens: Sequence[int]) -> Lesson:
    """A program to learn, with the grammar's masks."""
    state = GrammarState.start()
    masks = []
    for i, token in enumerate(tokens):
        masks.append(state.allowed_within(MAX_TOKENS - i))
        state = state.advance(token)
    return np.array(tokens), np.stack(masks)


def collate(lessons: Sequence[Lesson]) -> tuple[Tensor, Tensor]:
    """Tokens ``[batch, time]`` and masks ``[batch, time, vocab]``, padded to the longest."""
    tokens = pad([t.tolist() for t, _ in lessons])
    masks = np.zeros((*tokens.shape, len(VOCAB)), np.bool_)
    for row, (_, mask) in zip(masks, lessons, strict=True):
        row[: len(mask)] = mask
    return tokens.to(device()), torch.from_numpy(masks).to(device())


def _fit_likelihood(
    run: Run,
    model: Synthesizer,
    lessons: dict[int, Lesson],
    config: FitConfig,
    folder: Path,
    made_from: dict[str, Any],
) -> dict[str, float]:
    train = list(lessons)
    rows_at = batch_at([len(lessons[p][0]) for p in train], run.scale.lgrl_batch, run.seed)

    def loss_at(step: int, share: Share) -> tuple[Tensor, dict[str, float]]:
        positions = [train[i] for i in share.of(rows_at(step))]
        rng = np.random.default_rng([run.seed, 3, step, share.index])
        pairs = rng.permuted(np.tile(np.arange(EXAMPLES + 1), (len(positions), 1)), axis=1)
        features = run.task_features(positions, pairs[:, :EXAMPLES])  # the pair left out rotates
        return model.loss(features, *collate([lessons[p] for p in positions])), {}

    validation = Validation(run, model)
    return fit(model, loss_at, config, folder, validation, "semantic", made_from, run.tensorboard)


class Validation:
    """How good a synthesizer is on held-out tasks: its first program, run, and its likelihood."""

    def __init__(self, run: Run, model: Synthesizer) -> None:
        self.run, self.model = run, model
        self.tasks = run.dataset.split("validation")[:VALIDATION_TASKS]
        self.lessons = [lesson(run.programs[p]) for p in self.tasks]

    def __call__(self) -> dict[str, float]:
        """``semantic`` and ``exact`` match of the first program, and the ``loss``."""
        beams = self.run.beam(self.model, self.tasks, VALIDATION_BEAM)
        first: list[Program | None] = [beam[0] if beam else None for beam in beams]
        golds = [tuple(VOCAB.decode(self.run.programs[p])) for p in self.tasks]
        exact = [p is not None and p.tokens == gold for p, gold in zip(first, golds, strict=True)]
        return {
            "semantic": self.run.judge.share_right(self.tasks, first),
            "exact": float(np.mean(exact)),
            "loss": float(np.mean(list(self._losses()))),
        }

    def _losses(self) -> Any:
        for start in range(0, len(self.tasks), 64):
            part = slice(start, start + 64)
            features = self.run.task_features(self.tasks[part])
            yield self.model.loss(features, *collate(self.lessons[part])).item()


def _own_targets(run: Run, model: Synthesizer, positions: Sequence[int]) -> dict[int, Lesson]:
    """Where the decoded program reaches all outputs, it is a target as good as the gold one, and easier.

    Chen et al., 2021, section 3.4: one round of iterative retraining.
    """
    model.eval()
    beams = track(run.beam(model, positions, 1), len(positions), "own targets")
    decoded = zip(positions, beams, strict=True)
    own = {p: beam[0] for p, beam in decoded if beam and run.judge.matches(p, beam[:1]).all()}
    return {p: lesson(VOCAB.encode(program.tokens)) for p, program in own.items()}


def train_on_rewards(run: Run, model: Synthesizer, start: str) -> Path:
    """Reinforcement learning on the beam; the model has the weights of ``start`` already.

    A program's reward is +1 if it generalises to all six scenes, -1 if not (Bunel et al., 2018).
    """
    scale = run.scale
    config = FitConfig(
        scale.rl_steps, rate=1e-4, seed=run.seed, warmup=10, validate_every=50, patience=scale.patience
    )
    train = run.dataset.split("train")
    rows_at = batch_at([len(run.programs[p]) for p in train], scale.rl_batch, run.seed + 7)

    def loss_at(step: int, share: Share) -> tuple[Tensor, dict[str, float]]:
        return reward_loss(run, model, [train[i] for i in share.of(rows_at(step))])

    return run.save(
        model,
        model.name,
        config,
        fit(
            model,
            loss_at,
            config,
            run.out / model.name,
            Validation(run, model),
            "semantic",
            run.made_from(model, "encoder", start),
            run.tensorboard,
        ),
    )


def reward_loss(run: Run, model: Synthesizer, positions: Sequence[int]) -> tuple[Tensor, dict[str, float]]:
    """Minus the expected best reward of a bag of draws from the renormalised beam, a mean over tasks."""
    scale = run.scale
    features = run.task_features(positions)
    model.eval()  # the beam, and what it is worth, without dropout
    with autocast():
        groups = [[p.program for p in group] for group in beam_search(model, features, scale.rl_beam)]
    bests, means = [], []
    for position, programs, given in zip(positions, groups, features, strict=True):
        if not programs:
            continue
        right = run.judge.matches(position, programs).all(1)
        rewards = torch.from_numpy(np.where(right, 1.0, -1.0)).float().to(device())
        lessons = [lesson(VOCAB.encode(p.tokens)) for p in programs]
        given = given[None].expand(len(programs), *given.shape)
        scores = model.log_probabilities(given, *collate(lessons))
        bests.append(expected_best(scores, rewards, scale.rl_draws))
        means.append((scores.detach().softmax(-1) * rewards).sum().item())
    return -torch.stack(bests).mean(), {"reward": float(np.mean(means))}
