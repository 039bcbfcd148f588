"""The inverse model's training: all pairs of observations of random walks, embedded once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from evaps.domain import CHOSEN
from evaps.dsl.sampler import ACTIONS
from evaps.models import load_encoder
from evaps.models.checkpoint import hash_of
from evaps.models.compute import device
from evaps.models.inverse import AXES, InverseModel
from evaps.synthesis.features import embed
from evaps.tasks.frames import unpack_frames
from evaps.tasks.identity import short_hash
from evaps.tasks.walks import Walks
from evaps.train.encoder import find_walks, held_out
from evaps.train.features import in_parts
from evaps.train.loop import FitConfig, Share, fit
from evaps.train.run import Run

BATCH = 32  # walks, with 45 pairs each
EMBEDDED_TOGETHER = 32  # walks

Rows = npt.NDArray[np.int64]


def train_inverse(run: Run) -> Path:
    """Learn what is left to do between two observations."""
    walks = find_walks(run)
    features = walk_features(run, walks)
    counts = signed_counts(walks)
    torch.manual_seed(run.seed)
    model = InverseModel().to(device())
    config = FitConfig(run.scale.inverse_steps, rate=1e-3, seed=run.seed, validate_every=500)

    def loss_on(rows: Rows) -> tuple[Tensor, Tensor]:
        before, after, wanted = pairs_of(features[rows], counts[rows])
        logits = model(before, after)
        right = (logits.argmax(-1) - model.config.most == wanted).all(1)
        return model.loss(before, after, wanted), right

    def loss_at(step: int, share: Share) -> tuple[Tensor, dict[str, float]]:
        rng = np.random.default_rng([run.seed, 5, step])
        return loss_on(share.of(rng.integers(held_out(len(features)), len(features), BATCH)))[0], {}

    def validate() -> dict[str, float]:
        loss, right = loss_on(np.arange(held_out(len(features))))
        return {"loss": loss.item(), "right": right.float().mean().item()}

    made_from = run.made_from(model, ("walks", "task_walks"), "encoder")
    metrics = fit(model, loss_at, config, run.out / "inverse", validate, "right", made_from, run.tensorboard)
    return run.save(model, "inverse", config, metrics, made_from)


def walk_features(run: Run, walks: Walks) -> npt.NDArray[np.float16]:
    """The embeddings of the observations of all walks, ``[walk, time, feature]``; kept beside the walks."""
    folder = run.out / "encoder"
    key = short_hash([hash_of(folder), run.seed, run.scale.walks, run.scale.task_walks])
    path = run.dataset.folder / f"walk-features-{key}.npy"
    encoder = load_encoder(folder).to(device())

    def embedded(rows: range) -> npt.NDArray[np.float16]:
        parts = [rows[start : start + EMBEDDED_TOGETHER] for start in range(0, len(rows), EMBEDDED_TOGETHER)]
        seen = ([frame for row in part for frame in unpack_frames(walks.frames[row])] for part in parts)
        features = np.concatenate([embed(encoder, frames).cpu().numpy() for frames in seen])
        return features.astype(np.float16).reshape(len(rows), -1, encoder.config.feature)

    return in_parts(path, len(walks.frames), "features of walks", embedded)


def signed_counts(walks: Walks) -> npt.NDArray[np.float64]:
    """What has happened since the start of each walk, at each time: ``[walk, time, axis + 3]``.

    On each axis the actions that were done, and then the place in moves and the heading in radians.
    """
    one_hot = np.eye(len(ACTIONS))[walks.actions]
    done = np.concatenate([np.zeros_like(one_hot[:, :1]), one_hot.cumsum(1)], 1)

    def times(action: str | None) -> npt.NDArray[np.float64]:
        return done[..., ACTIONS.index(action)] if action else np.zeros(done.shape[:2])

    counted = np.stack([times(axis.onwards) - times(axis.back) for axis in AXES], -1)
    places, heading = walks.poses[..., :2] / CHOSEN.move, np.deg2rad(walks.poses[..., 2:])
    return np.concatenate([counted, places, heading], -1)


def pairs_of(
    features: npt.NDArray[np.float16], counts: npt.NDArray[np.float64]
) -> tuple[Tensor, Tensor, Tensor]:
    """All (earlier, later) observations of walks, and what happened in between, as counts on ``AXES``."""
    length = features.shape[1]
    early, late = np.array([(i, j) for i in range(length) for j in range(i, length)]).T
    before, change = counts[:, early], counts[:, late] - counts[:, early]
    x, y, heading = change[..., -3], change[..., -2], before[..., -1]
    moved = {
        "ahead": x * np.cos(heading) + y * np.sin(heading),
        "left": y * np.cos(heading) - x * np.sin(heading),
    }
    axes = [moved.get(axis.measured, change[..., i]) for i, axis in enumerate(AXES)]
    wanted = np.rint(np.stack(axes, -1)).astype(np.int64).reshape(-1, len(AXES))
    seen = [features[:, times].reshape(-1, features.shape[-1]) for times in (early, late)]
    tensors = [torch.from_numpy(rows.astype(np.float32)).to(device()) for rows in seen]
    return tensors[0], tensors[1], torch.from_numpy(wanted).to(device())
