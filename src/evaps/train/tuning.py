"""Stage 0 continued: the encoder learns what programs need, with a synthesizer that is thrown away.

The paper goes on to train its encoder with each method. Here one encoder serves all methods, so that they can
be compared and its embeddings kept; so it is trained further once, with LGRL's likelihood, and with the walks
of stage 0, lest what it knows of transitions is forgotten. Then it is frozen.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor, nn

from evaps.models import PROPOSER, new_method
from evaps.models.base import Synthesizer
from evaps.models.compute import device
from evaps.models.encoder import TransitionModel
from evaps.models.pairs import start_pairs
from evaps.synthesis.features import stack_frames
from evaps.tasks.frames import unpack_frames
from evaps.tasks.task import EXAMPLES
from evaps.train.batches import batch_at, one_ahead, rotating_pairs
from evaps.train.lessons import Lessons
from evaps.train.loop import FitConfig, LossAt, Share, fit
from evaps.train.run import Run

BATCH = 32  # tasks; each has ten frames
MOST_TASKS = 20_000  # training tasks whose frames are kept in memory, 94 KB each
VALIDATION_TASKS = 256
TUNING_DRAWS = 4  # tells these draws from those of other trainings with the same seed


class TunedEncoder(nn.Module):
    """A transition model, and a synthesizer that sees through the same encoder.

    The statistics of its batch normalisations stay those of stage 0.

    Args:
        transitions: as stage 0 has left it.
        synthesizer: with fresh weights.
    """

    def __init__(self, transitions: TransitionModel, synthesizer: Synthesizer) -> None:
        super().__init__()
        self.transitions, self.synthesizer = transitions, synthesizer

    def train(self, mode: bool = True) -> TunedEncoder:
        """Set the mode of all but the encoder, whose parameters learn all the same."""
        super().train(mode)
        self.transitions.encoder.eval()
        return self

    def likelihood_loss(
        self, frames: UInt8[Tensor, "frame height width 4"], tokens: Tensor, masks: Tensor
    ) -> Float[Tensor, ""]:
        """The synthesizer's loss.

        Args:
            frames: of every task its pairs, of every pair its first observation and its goal.
            tokens: of the programs.
            masks: of the grammar.
        """
        embedded = self.transitions.encoder(frames).unflatten(0, (len(tokens), -1, 2))
        return self.synthesizer.loss(embedded, tokens, masks)


class TaskFrames:
    """The frames of tasks with their programs, packed in memory and unpacked in batches.

    Args:
        run: the training.
        positions: of the tasks.
    """

    def __init__(self, run: Run, positions: Sequence[int]) -> None:
        packed = dict(run.dataset.frames(positions))
        self.packed = [packed[position] for position in positions]
        self.lessons = Lessons.of([run.programs[position] for position in positions])

    def frames(self, rows: Iterable[int], pairs: np.ndarray[Any, Any]) -> Tensor:
        """Frames of tasks, bytes ``[frame, height, width, 4]``, in the order that `TunedEncoder` wants.

        Args:
            rows: which tasks.
            pairs: which pairs of each, ``[task, pair]``.
        """
        chosen = []
        for row, wanted in zip(rows, pairs, strict=True):
            every = unpack_frames(self.packed[row])  # first observations, then last ones
            chosen += [every[time * (EXAMPLES + 1) + pair] for pair in wanted for time in (0, 1)]
        return stack_frames(chosen)


def tune_encoder(
    run: Run,
    model: TransitionModel,
    walks_loss: LossAt,
    validate: Callable[[], dict[str, float]],
    made_from: dict[str, Any],
) -> dict[str, Any]:
    """Train an encoder further, on walks and on tasks at once.

    Args:
        run: the training.
        model: what stage 0 has made; trained in place.
        walks_loss: stage 0's loss of a step.
        validate: stage 0's metrics on walks that are held out.
        made_from: what stage 0's result depends on.

    Returns:
        the facts for the checkpoint: how it was fitted, tasks a batch, and the metrics, with
        ``validation_programs``, the log-likelihood of a token of a held-out task's program.
    """
    torch.manual_seed(run.seed)
    synthesizer = new_method(PROPOSER)
    assert isinstance(synthesizer, Synthesizer)
    start_pairs(synthesizer, model.pair.state_dict())
    tuned = TunedEncoder(model, synthesizer).to(device())
    tasks_loss = _tasks_loss(run, tuned, TaskFrames(run, run.dataset.split("train")[:MOST_TASKS]))
    held = TaskFrames(run, run.dataset.split("validation")[:VALIDATION_TASKS])

    def loss_at(step: int, share: Share) -> tuple[Tensor, dict[str, float]]:
        walks, metrics = walks_loss(run.scale.encoder_steps + step, share)  # not those of stage 0 again
        programs = tasks_loss(step, share)
        return walks + programs, {**metrics, "programs": -programs.item()}

    def validated() -> dict[str, float]:
        return {**validate(), "programs": -_held_out_loss(tuned, held)}

    config = FitConfig(run.scale.tuning_steps, rate=5e-4, seed=run.seed, validate_every=500)
    folder = run.out / "encoder" / "tuning"
    settings = {**made_from, "batch": BATCH, "tasks": MOST_TASKS}
    metrics = fit(tuned, loss_at, config, folder, validated, "programs", settings, run.tensorboard)
    return {"fit": asdict(config), "batch": BATCH, "metrics": {k: round(v, 5) for k, v in metrics.items()}}


def _tasks_loss(run: Run, tuned: TunedEncoder, tasks: TaskFrames) -> Callable[[int, Share], Tensor]:
    rows_at = batch_at(tasks.lessons.lengths, BATCH, run.seed)

    def batch(step: int, share: Share) -> tuple[Any, Tensor]:
        rows = share.of(rows_at(step))
        rng = np.random.default_rng([run.seed, TUNING_DRAWS, step, share.index])
        return rows, tasks.frames(rows, rotating_pairs(len(rows), rng))

    batches = one_ahead(batch)

    def loss(step: int, share: Share) -> Tensor:
        rows, frames = batches(step, share)
        return tuned.likelihood_loss(frames.to(device()), *tasks.lessons.batch(rows))

    return loss


def _held_out_loss(tuned: TunedEncoder, held: TaskFrames) -> float:
    losses = []
    for start in range(0, len(held.packed), BATCH):
        rows = range(start, min(start + BATCH, len(held.packed)))
        frames = held.frames(rows, np.tile(np.arange(EXAMPLES), (len(rows), 1)))
        losses.append(tuned.likelihood_loss(frames.to(device()), *held.lessons.batch(rows)).item())
    return float(np.mean(losses))
