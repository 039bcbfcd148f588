"""Stage 0: the observation encoder, trained on random walks and on tasks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from evaps.domain import CHOSEN
from evaps.dsl.sampler import ACTIONS, PERCEPTION_KEYS
from evaps.models.compute import device
from evaps.models.encoder import EncoderConfig, TransitionModel, Transitions
from evaps.robots.base import Scene
from evaps.robots.world import world
from evaps.synthesis.features import stack_frames
from evaps.tasks.frames import unpack_frames
from evaps.tasks.task import EXAMPLES
from evaps.tasks.walks import Walks, generate_walks
from evaps.train.batches import one_ahead
from evaps.train.loop import FitConfig, LossAt, Share, fit
from evaps.train.run import Run
from evaps.train.tuning import tune_encoder

HELD_OUT = 250  # walks that are only validated on; of few walks half
MOST_NOISE = 0.2  # share of pixels that are dropped from half of the frames


def train_encoder(run: Run) -> Path:
    """Learn the embedding space from walks and, at scales that say so, go on with what programs need."""
    walks = find_walks(run)
    torch.manual_seed(run.seed)
    height, width = world().size
    sizes = EncoderConfig(height=height, width=width, actions=len(ACTIONS), perceptions=len(PERCEPTION_KEYS))
    model = TransitionModel(sizes).to(device())
    batches = WalkBatches(walks, run.scale.encoder_batch, run.seed)
    config = FitConfig(run.scale.encoder_steps, rate=1e-3, seed=run.seed, validate_every=500)
    made_from = run.made_from(model, ("walks", "task_walks", "encoder_batch"))
    loss_at, validated = encoder_loss(model, batches), validate(model, batches)
    metrics = fit(
        model, loss_at, config, run.out / "encoder", validated, "counts", made_from, run.tensorboard
    )
    tuning: dict[str, Any] = {}
    if run.scale.tuning_steps:
        tuning = {"tuning": tune_encoder(run, model, loss_at, validated, made_from)}
    return run.save(model.encoder, "encoder", config, metrics, made_from, **tuning)


def held_out(walks: int) -> int:
    """How many of the walks, the first ones, are only validated on."""
    return min(HELD_OUT, walks // 2)


def find_walks(run: Run) -> Walks:
    """Random walks; some begin as a training program did."""
    train = run.dataset.split("train")[: run.scale.task_walks]
    rows = (run.dataset.rows[p] for p in train)
    starts = [_start(row, row["index"] % EXAMPLES) for row in rows]
    folder = run.dataset.folder / "walks"
    return Walks.read(generate_walks(folder, run.scale.walks, run.seed, run.workers, starts))


def _start(row: dict[str, Any], example: int) -> tuple[Scene, tuple[str, ...]]:
    return Scene.from_json(row["scenes"][example]), tuple(row["actions"][example].split())


def pairs_of(length: int) -> npt.NDArray[np.int64]:
    """All (earlier, later) times of a walk, ``[pair, 2]``."""
    return np.array([(i, j) for i in range(length + 1) for j in range(i + 1, length + 1)])


def transitions(walks: Walks, rows: npt.NDArray[np.int64], actions: int) -> Transitions:
    """What happened between all pairs of observations of the chosen walks."""
    length = walks.actions.shape[1]
    pairs = pairs_of(length)
    one_hot = np.eye(actions, dtype=np.int64)[walks.actions[rows]]
    done = np.concatenate([np.zeros_like(one_hot[:, :1]), one_hot.cumsum(1)], 1)
    early, late = pairs.T
    offset = (np.arange(len(rows)) * (length + 1))[:, None]
    arrays: list[npt.NDArray[Any]] = [
        (offset + early).ravel(),
        (offset + late).ravel(),
        (done[:, late] - done[:, early]).reshape(-1, actions),
        walks.actions[rows][:, early].ravel(),
        walks.actions[rows][:, late - 1].ravel(),
        _change(walks.poses[rows], walks.ammo[rows], early, late).reshape(-1, 5),
    ]
    return Transitions(*map(torch.from_numpy, arrays))


def _change(
    poses: npt.NDArray[np.float32], ammo: npt.NDArray[np.int64], early: Any, late: Any
) -> npt.NDArray[np.float32]:
    before, after = poses[:, early], poses[:, late]
    heading = np.deg2rad(before[..., 2])
    turn = np.deg2rad(after[..., 2]) - heading
    dx, dy = np.moveaxis((after - before)[..., :2] / (2.5 * CHOSEN.move), -1, 0)  # 1 is a middling way
    forward = dx * np.cos(heading) + dy * np.sin(heading)
    left = dy * np.cos(heading) - dx * np.sin(heading)
    spent = (ammo[:, early] - ammo[:, late]).astype(np.float32) / 4
    return np.stack([forward, left, np.sin(turn), np.cos(turn), spent], -1).astype(np.float32)


@dataclass(frozen=True)
class WalkBatches:
    """Frames and transitions for each step; the next batch is unpacked while the model works on this one."""

    walks: Walks
    size: int
    seed: int

    def at(self, step: int) -> npt.NDArray[np.int64]:
        """The walks of a step."""
        rng = np.random.default_rng([self.seed, step])
        walks = len(self.walks.frames)
        return rng.integers(held_out(walks), walks, self.size)

    def noisy_frames(self, step: int, share: Share) -> Tensor:
        """The frames of a step, with dropped pixels."""
        rng = np.random.default_rng([self.seed, step, 1 + share.index])
        return drop_pixels(self.frames(share.of(self.at(step))), rng)

    def frames(self, rows: npt.NDArray[np.int64]) -> Tensor:
        """Their frames, bytes ``[frame, height, width, 4]``."""
        return stack_frames([frame for row in rows for frame in unpack_frames(self.walks.frames[row])])


def drop_pixels(frames: Tensor, rng: np.random.Generator) -> Tensor:
    """Augmentation, in place: in half of the frames a random share of the pixels is 0 in every channel."""
    chosen = rng.permutation(len(frames))[: len(frames) // 2]
    share = rng.integers(0, int(256 * MOST_NOISE), (len(chosen), 1, 1))
    kept = rng.integers(0, 256, (len(chosen), *frames.shape[1:3]), dtype=np.uint8) >= share
    frames[chosen] *= torch.from_numpy(kept)[..., None].to(torch.uint8)
    return frames


def encoder_loss(model: TransitionModel, batches: WalkBatches) -> LossAt:
    """The loss of each step."""
    frames_of = one_ahead(batches.noisy_frames)

    def loss_at(step: int, share: Share) -> tuple[Tensor, dict[str, float]]:
        return batch_loss(model, batches.walks, share.of(batches.at(step)), frames_of(step, share))

    return loss_at


def batch_loss(
    model: TransitionModel, walks: Walks, rows: npt.NDArray[np.int64], frames: Tensor
) -> tuple[Tensor, dict[str, float]]:
    """The loss on the chosen walks."""
    perceived = torch.from_numpy(walks.perceptions[rows]).flatten(0, 1)
    where = device()
    happened = transitions(walks, rows, model.config.actions).to(where)
    return model.loss(frames.to(where), perceived.to(where), happened)


def validate(model: TransitionModel, batches: WalkBatches) -> Callable[[], dict[str, float]]:
    """Mean metrics on the walks that are held out."""

    def metrics() -> dict[str, float]:
        results = list(_validation_batches(model, batches))
        return {key: float(np.mean([r[key] for r in results])) for key in results[0]}

    return metrics


def _validation_batches(model: TransitionModel, batches: WalkBatches) -> Iterator[dict[str, float]]:
    end = held_out(len(batches.walks.frames))
    for start in range(0, end, batches.size):
        rows = np.arange(start, min(start + batches.size, end))
        loss, metrics = batch_loss(model, batches.walks, rows, batches.frames(rows))
        yield {"loss": loss.item(), **metrics}
