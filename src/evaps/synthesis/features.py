"""Embeddings of what a robot saw: each observation is embedded once."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from evaps.models import load_encoder
from evaps.models.base import Execution
from evaps.models.compute import autocast
from evaps.models.encoder import Encoder
from evaps.robots.frames import Observation, PaletteFrame, digest
from evaps.robots.noise import NoisyFrame, noisy_view
from evaps.synthesis.solution import Attempt
from evaps.tasks.frames import rgbd
from evaps.tasks.task import Task

BATCH = 128


def stack_frames(observations: Sequence[Observation]) -> UInt8[Tensor, "batch height width 4"]:
    """RGB and depth of observations as one tensor of bytes."""
    observations = [getattr(o, "frame", o) for o in observations]  # what is remembered, as it is held
    doom = [o for o in observations if isinstance(o, PaletteFrame)]
    if len(doom) == len(observations):
        return torch.from_numpy(rgbd(doom))
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
