"""How synthesizers learn: the gold programs' likelihood, with validation by running what is proposed."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from torch import Tensor

from evaps.dsl import VOCAB, Program
from evaps.files import write_atomically
from evaps.models.base import Synthesizer
from evaps.tasks.progress import track
from evaps.train.batches import batch_at, rotating_pairs
from evaps.train.lessons import Lessons
from evaps.train.loop import FitConfig, Share, fit
from evaps.train.run import Run

VALIDATION_TASKS = 512
VALIDATION_BEAM = 4
OWN_TOGETHER = 200  # training tasks whose own targets are kept together


def train_synthesizer(run: Run, model: Synthesizer) -> Path:
    """Maximum likelihood, and, if the method asks for it, a second round on targets of its own.

    Chen et al., 2021, section 3.4 (one round of iterative retraining); what is worse after it is not kept.
    """
    run.start_from_pairs(model)
    scale = run.scale
    config = FitConfig(
        scale.synthesizer_steps, rate=1e-3, seed=run.seed, validate_every=500, patience=scale.patience
    )
    sizes = ("synthesizer_batch", "retrained_tasks") if model.retrains else ("synthesizer_batch",)
    made_from = run.made_from(model, sizes, "encoder", "inverse")
    train = run.dataset.split("train")
    targets = [run.programs[p] for p in train]
    metrics = fit_likelihood(run, model, train, targets, config, run.out / model.name, made_from)
    if model.retrains:
        first = {key: value.clone() for key, value in model.state_dict().items()}
        folder = run.out / model.name / "retrained"
        with run.main_process_first():
            own = _own_targets(run, model, train[: scale.retrained_tasks], folder)
        again = FitConfig(config.steps // 4, 3e-4, run.seed + 1, validate_every=500, patience=config.patience)
        targets = [own.get(p, run.programs[p]) for p in train]
        second = fit_likelihood(run, model, train, targets, again, folder, {**made_from, "first": metrics})
        if second["validation_score"] >= metrics["validation_score"]:
            metrics = second
        else:
            model.load_state_dict(first)
    return run.save(model, model.name, config, metrics, made_from)


def fit_likelihood(
    run: Run,
    model: Synthesizer,
    positions: Sequence[int],
    targets: Sequence[Sequence[int]],
    config: FitConfig,
    folder: Path,
    made_from: dict[str, Any],
) -> dict[str, float]:
    """Fit a synthesizer to the likelihood of a target for each task.

    Args:
        run: the training.
        model: what is fitted.
        positions: of the tasks.
        targets: token ids of a program for each of them.
        config: how.
        folder: of the state and the metrics.
        made_from: what the result depends on.
    """
    lessons = Lessons.of(targets)
    rows_at = batch_at(lessons.lengths, run.scale.synthesizer_batch, run.seed)

    def loss_at(step: int, share: Share) -> tuple[Tensor, dict[str, float]]:
        rows = share.of(rows_at(step))
        rng = np.random.default_rng([run.seed, 3, step, share.index])
        pairs = rotating_pairs(len(rows), rng)
        given = run.given(model, [positions[row] for row in rows], pairs)
        return model.loss(given, *lessons.batch(rows)), {}

    return fit(model, loss_at, config, folder, Validation(run, model), "score", made_from, run.tensorboard)


class Validation:
    """How good a synthesizer is on held-out tasks: its first programs, run, and its likelihood.

    Args:
        run: the training.
        model: the synthesizer.
    """

    def __init__(self, run: Run, model: Synthesizer) -> None:
        self.run, self.model = run, model
        self.tasks = run.dataset.split("validation")[:VALIDATION_TASKS]
        self.lessons = Lessons.of([run.programs[p] for p in self.tasks])

    def __call__(self) -> dict[str, float]:
        """``semantic`` and ``exact`` match of the first program, ``solved`` by the first four, the ``loss``.

        ``score`` is ``solved - loss``: matches alone jump about by a point or two on 512 tasks.
        """
        beams = list(self.run.beam(self.model, self.tasks, VALIDATION_BEAM))
        first: list[Program | None] = [beam[0] if beam else None for beam in beams]
        golds = [tuple(VOCAB.decode(self.run.programs[p])) for p in self.tasks]
        exact = [p is not None and p.tokens == gold for p, gold in zip(first, golds, strict=True)]
        solved = [self.run.judge.solve(p, beam).any() for p, beam in zip(self.tasks, beams, strict=True)]
        loss = float(np.mean(list(self._losses())))
        return {
            "semantic": self.run.judge.share_right(self.tasks, first),
            "exact": float(np.mean(exact)),
            "solved": float(np.mean(solved)),
            "loss": loss,
            "score": float(np.mean(solved)) - loss,
        }

    def _losses(self) -> Iterator[float]:
        for start in range(0, len(self.tasks), 64):
            rows = range(start, min(start + 64, len(self.tasks)))
            given = self.run.given(self.model, [self.tasks[row] for row in rows])
            yield self.model.loss(given, *self.lessons.batch(rows)).item()


def _own_targets(
    run: Run, model: Synthesizer, positions: Sequence[int], folder: Path
) -> dict[int, list[int]]:
    """Where the decoded program reaches all outputs, it is a target as good as the gold one, and easier.

    They are kept in the folder, a file for some of the tasks, so that this can be interrupted.
    """
    model.eval()
    own: dict[int, list[int]] = {}
    starts = range(0, len(positions), OWN_TOGETHER)
    for start in track(starts, len(positions), "own targets", 0, OWN_TOGETHER):
        path = folder / f"own-{start:06d}.json"
        if not path.exists():
            found = _own_programs(run, model, positions[start : start + OWN_TOGETHER])
            write_atomically(path, json.dumps(found).encode())
        own |= {position: VOCAB.encode(program.split()) for position, program in json.loads(path.read_text())}
    return own


def _own_programs(run: Run, model: Synthesizer, positions: Sequence[int]) -> list[tuple[int, str]]:
    beams = zip(positions, run.beam(model, positions, 1), strict=True)
    return [(p, str(beam[0])) for p, beam in beams if beam and run.judge.generalize(p, beam[:1]).all()]
