"""The embeddings of many observations: computed once, in parts, and kept beside the data set."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import torch
from accelerate import PartialState
from torch import Tensor

from evaps.files import write_atomically
from evaps.models.compute import device
from evaps.models.encoder import Encoder
from evaps.synthesis.features import array_bytes, embed
from evaps.tasks.dataset import Dataset
from evaps.tasks.frames import unpack_frames
from evaps.tasks.progress import track
from evaps.tasks.task import EXAMPLES

PART = 1_000  # tasks or walks whose embeddings are lost together where the job is stopped
TOGETHER = 10  # tasks whose frames are embedded at once

Features = np.ndarray[Any, np.dtype[np.float16]]
"""Of every task, of its examples (the test example too: LGRL learns from any five of six), of their first and
their last observation: ``[task, pair, 2, feature]``. Or of every walk: ``[walk, time, feature]``."""


def features_of(features: Features, positions: Sequence[int], pairs: Any) -> Tensor:
    """Those of some tasks, float32 ``[task, pair, 2, feature]``, on the device.

    Args:
        features: of all tasks.
        positions: of the tasks.
        pairs: which examples: a slice for all of the tasks, or rows ``[task, pair]``.
    """
    rows = np.asarray(positions)
    chosen = features[rows][:, pairs] if isinstance(pairs, slice) else features[rows[:, None], pairs]
    return torch.from_numpy(chosen.astype(np.float32)).to(device())


def dataset_features(dataset: Dataset, encoder: Encoder, key: str) -> Features:
    """The embeddings of every example's first and last observation.

    Stopped at any moment, the same call goes on.

    Args:
        dataset: whose observations.
        encoder: in evaluation mode.
        key: tells this encoder from others.
    """
    path = dataset.folder / f"features-{key}-{len(dataset)}.npy"
    return in_parts(path, len(dataset), "features of tasks", lambda rows: _features(dataset, rows, encoder))


def in_parts(path: Path, count: int, what: str, make: Callable[[range], Features]) -> Features:
    """An array in a file; made part by part if it is not there, so that this can be interrupted.

    Where several processes train together, the first one makes it and the others wait.

    Args:
        path: the file.
        count: rows of the array.
        what: a row's name, for the progress.
        make: the rows of a range.
    """
    with PartialState().main_process_first():
        if not path.exists():
            parts = path.with_suffix(".parts")
            files = {start: parts / f"part-{start:07d}.npy" for start in range(0, count, PART)}
            missing = [start for start, file in files.items() if not file.exists()]
            done = PART * (len(files) - len(missing))
            for start in track(missing, count, what, done, PART):
                write_atomically(files[start], array_bytes(make(range(start, min(start + PART, count)))))
            write_atomically(path, array_bytes(np.concatenate([np.load(file) for file in files.values()])))
            shutil.rmtree(parts)
    features: Features = np.load(path)
    return features


def _features(dataset: Dataset, positions: range, encoder: Encoder) -> Features:
    pairs = EXAMPLES + 1
    out = np.empty((len(positions), pairs, 2, encoder.config.feature), np.float16)
    packed = dataset.frames(positions)
    while tasks := list(islice(packed, TOGETHER)):
        observations = [frame for _, frames in tasks for frame in unpack_frames(frames)]
        embedded = embed(encoder, observations).cpu().numpy()
        rows = [position - positions.start for position, _ in tasks]
        out[rows] = embedded.reshape(-1, 2, pairs, out.shape[-1]).swapaxes(1, 2)
    return out
