"""Embeddings of what a robot saw: each observation is embedded once."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from evaps.files import write_atomically
from evaps.models import load_encoder
from evaps.models.base import Execution
from evaps.models.compute import autocast
from evaps.models.encoder import Encoder
from evaps.robots.frames import Observation, PaletteFrame, digest
from evaps.robots.noise import NoisyFrame, noisy_view
from evaps.synthesis.solution import Attempt
from evaps.tasks.dataset import Dataset
from evaps.tasks.frames import rgbd, unpack_frames
from evaps.tasks.progress import track
from evaps.tasks.task import EXAMPLES, Task

BATCH = 128


def stack_frames(observations: Sequence[Observation]) -> UInt8[Tensor, "batch height width 4"]:
    """RGB and depth of observations as one tensor of bytes."""
    observations = [getattr(o, "frame", o) for o in observations]  # what is remembered, as it is held
    doom = [o for o in observations if isinstance(o, PaletteFrame)]
    if len(doom) == len(observations):
        return rgbd(doom)
    first = observations[0].depth
    out = np.empty((len(observations), *first.shape, 4), np.uint8)
    for row, observation in zip(out, observations, strict=True):
        row[..., :3] = observation.rgb
        row[..., 3] = observation.depth
    return torch.from_numpy(out)


@torch.inference_mode()
def embed(encoder: Encoder, observations: Sequence[Observation]) -> Float[Tensor, "batch feature"]:
    """The embeddings of observations, in float32."""
    device = encoder.linear.weight.device
    parts = []
    for start in range(0, len(observations), BATCH):
        frames = stack_frames(observations[start : start + BATCH])
        with autocast():
            parts.append(encoder(frames.to(device)).float())
    return torch.cat(parts)


@cache
def encoder_of(folder: Path) -> Encoder:
    """The encoder in a folder, loaded once in a process.

    Raises:
        CheckpointError: there is none, or it is of another version.
    """
    return load_encoder(folder)


def array_bytes(array: np.ndarray[Any, Any]) -> bytes:
    """An array as a ``.npy`` file."""
    content = io.BytesIO()
    np.save(content, array)
    return content.getvalue()


def dataset_features(dataset: Dataset, encoder: Encoder, key: str) -> np.ndarray[Any, np.dtype[np.float16]]:
    """The embeddings of every example's first and last observation, float16 ``[task, pair, 2, feature]``.

    They are computed once and kept beside the data set.

    Args:
        dataset: whose observations.
        encoder: in evaluation mode.
        key: tells this encoder from others.
    """
    path = dataset.folder / f"features-{key}-{len(dataset)}.npy"
    if not path.exists():
        examples = EXAMPLES + 1  # the test example too, for training tasks: LGRL learns from any five of six
        out = np.empty((len(dataset), examples, 2, encoder.config.feature), np.float16)
        packed = dataset.frames(range(len(dataset)))
        tens = iter(lambda: list(islice(packed, 10)), [])
        for tasks in track(tens, len(dataset), "features of tasks", 0, 10):
            observations = [frame for _, frames in tasks for frame in unpack_frames(frames)]
            embedded = embed(encoder, observations).cpu().numpy()
            by_task = embedded.reshape(-1, 2, examples, out.shape[-1]).swapaxes(1, 2)
            out[[position for position, _ in tasks]] = by_task
        write_atomically(path, array_bytes(out))
    return np.load(path)


class FeatureTable:
    """A growing table of embeddings; an observation that looks like one before is looked up.

    Args:
        encoder: in evaluation mode.
        noise: share of the pixels of every view that are dropped before it is embedded; goals have theirs.

    Attributes:
        table: float32 ``[row, feature]``, complete after `rows`.
    """

    def __init__(self, encoder: Encoder, noise: float = 0.0) -> None:
        self.encoder, self.noise = encoder, noise
        self.table = torch.empty(0, encoder.config.feature, device=encoder.linear.weight.device)
        self._rows: dict[bytes, int] = {}

    def rows(self, observations: Iterable[Observation]) -> list[int]:
        """The rows of these observations; new ones are embedded together."""
        by_digest = [(digest(o), o) for o in observations]
        new = {key: o for key, o in by_digest if key not in self._rows}
        if new:
            for key in new:
                self._rows[key] = len(self._rows)
            self.table = torch.cat([self.table, embed(self.encoder, list(map(self._as_seen, new.values())))])
        return [self._rows[key] for key, _ in by_digest]

    def _as_seen(self, observation: Observation) -> Observation:
        if not self.noise or isinstance(observation, NoisyFrame):
            return observation
        return noisy_view(observation, self.noise)

    def executions(self, attempts: Sequence[Attempt], task: Task) -> list[Execution]:
        """What a repairer is told of these attempts."""
        goals = [example.goal for example in task.examples]
        self.rows([*goals, *(o for a in attempts for t in a.traces for o in t.observations)])  # all at once
        return [self._execution(attempt, goals) for attempt in attempts]

    def _execution(self, attempt: Attempt, goals: Sequence[Observation]) -> Execution:
        shape = (len(attempt.traces), len(attempt.program.segments))
        before, after = np.full(shape, -1), np.full(shape, -1)
        events = []
        for pair, trace in enumerate(attempt.traces):
            rows = self.rows(trace.observations)
            events += [(pair, event.segment, rows[event.time]) for event in trace.events]
            for segment, (entered, left) in trace.segment_times.items():
                before[pair, segment], after[pair, segment] = rows[entered], rows[left]
        first = self.rows(trace.observations[0] for trace in attempt.traces)
        final = self.rows(trace.observations[-1] for trace in attempt.traces)
        ends = (np.array(first), np.array(final), np.array(self.rows(goals)))
        return Execution(attempt.program, before, after, *ends, np.array(events, np.int64).reshape(-1, 3))
