"""Training a method by its name: what it needs, and who trains it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import torch

from evaps.dsl import UserError
from evaps.models import METHODS, PROPOSER, SEARCHES, check_encoder, is_repairer, new_method
from evaps.models.base import Synthesizer
from evaps.models.checkpoint import CheckpointError, load_weights
from evaps.models.compute import device
from evaps.models.inferred_trace import InferredTrace
from evaps.robots.workers import TWO, Workers
from evaps.tasks.dataset import Dataset
from evaps.train.encoder import train_encoder
from evaps.train.inferred_trace import train_inferred_trace
from evaps.train.inverse import train_inverse
from evaps.train.repairers import train_repairer
from evaps.train.rewards import train_on_rewards
from evaps.train.run import Run
from evaps.train.scale import SCALES
from evaps.train.synthesizers import train_synthesizer


def train(
    method: str,
    data: Path,
    out: Path,
    scale: str = "small",
    seed: int = 0,
    workers: Workers = TWO,
    tensorboard: bool = False,
    tuning: int | None = None,
) -> Path:
    """Train a method, or go on with it; needs what comes before it: encoder, inverse model, synthesizer.

    Args:
        method: ``"encoder"``, ``"inverse"`` or a name in METHODS.
        data: folder of a data set.
        out: folder of the checkpoints; each method gets a folder in it.
        scale: a name in SCALES.
        seed: of everything random in the training.
        workers: who simulates.
        tensorboard: write metrics for TensorBoard, too.
        tuning: of the encoder: further batches in which it learns with a synthesizer; None for the scale's.

    Returns:
        the checkpoint's folder.

    Raises:
        UserError: an unknown method or scale, no data set, or other settings than those it was begun with.
        CheckpointError: what comes before it is missing, or was trained with another encoder.
    """
    if scale not in SCALES:
        raise UserError(f"there is no scale {scale!r}; known are {', '.join(SCALES)}")
    if tuning is not None and method != "encoder":
        raise UserError(f"tuning is for the encoder, not for {method}; all methods see through the same one")
    start = None
    if method not in ("encoder", "inverse"):
        if method in SEARCHES:
            used = ", ".join(SEARCHES[method])
            raise UserError(f"{method!r} is a search, which is not trained; train what it uses: {used}")
        start = PROPOSER if is_repairer(method) else METHODS[method].start
    run = Run(Dataset(data), out, scale, seed, workers, tensorboard)
    if tuning is not None:
        run.scale = replace(run.scale, tuning_steps=tuning)
    if method == "encoder":
        return train_encoder(run)
    before = [needed for needed in ("encoder", "inverse", start) if needed not in (None, method)]
    for needed in before:
        _check_there(out, needed, method, data)
    check_encoder(out, before)
    if method == "inverse":
        return train_inverse(run)
    torch.manual_seed(seed)
    model = new_method(method).to(device())
    if not isinstance(model, Synthesizer):
        return train_repairer(run, model)
    if isinstance(model, InferredTrace):
        return train_inferred_trace(run, model)
    if start is None:
        return train_synthesizer(run, model)
    return train_on_rewards(run, load_weights(out / start, model), start)


def _check_there(out: Path, needed: str, method: str, data: Path) -> None:
    if not (out / needed / "config.json").exists():
        first = f"evaps train {needed} --data {data} --out {out}"
        raise CheckpointError(f"{method} needs the checkpoint of {needed} in {out}; first: {first}")
