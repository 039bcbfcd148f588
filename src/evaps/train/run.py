"""What all trainings have in common: a data set, its features, checkpoints to start from and to write."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

import torch
from accelerate import PartialState

from evaps.dsl import VOCAB, Program
from evaps.models import load_encoder, load_inverse
from evaps.models.base import Synthesizer
from evaps.models.beam import beam_search
from evaps.models.checkpoint import hash_of, save_checkpoint
from evaps.models.compute import autocast, device, precision
from evaps.models.pairs import start_pairs
from evaps.robots.workers import Workers
from evaps.synthesis.ways import WayTable
from evaps.tasks.dataset import Dataset
from evaps.tasks.identity import code_version
from evaps.tasks.task import EXAMPLES
from evaps.train.features import Features, dataset_features, features_of
from evaps.train.judge import Judge
from evaps.train.loop import FitConfig
from evaps.train.scale import SCALES

DECODED_TOGETHER = 16  # tasks


class Run:
    """One call of `evaps.train.train`.

    Args:
        dataset: what is learned from.
        out: folder of the checkpoints; each method has a folder in it.
        scale: a name in SCALES.
        seed: of everything random in the training.
        workers: who simulates.
        tensorboard: write metrics for it, too.
    """

    def __init__(
        self, dataset: Dataset, out: Path, scale: str, seed: int, workers: Workers, tensorboard: bool = False
    ) -> None:
        self.dataset, self.out, self.seed, self.workers = dataset, out, seed, workers
        self.scale_name, self.scale = scale, SCALES[scale]
        self.tensorboard = tensorboard
        self.ways: tuple[WayTable, dict[int, int]] | None = None  # and the row of each position
        self._start, self._commit = time.monotonic(), code_version()
        self._processes = PartialState()  # which device is whose, before anything is put on one

    def main_process_first(self) -> AbstractContextManager[None]:
        """Where several processes train together, the first one makes files and the others find them."""
        return self._processes.main_process_first()

    @cached_property
    def programs(self) -> list[list[int]]:
        """The token ids of every task's program."""
        return [VOCAB.encode(program.split()) for program in self.dataset.rows.column("program")]

    @cached_property
    def features(self) -> Features:
        """Of every example's first and last observation, ``[task, pair, 2, feature]``."""
        folder = self.out / "encoder"
        return dataset_features(self.dataset, load_encoder(folder).to(device()), hash_of(folder))

    def load_features(self) -> None:
        """Have them now: several processes meet there, so not while one of them goes ahead."""
        _ = self.features

    @cached_property
    def position_of(self) -> dict[int, int]:
        """The position of the task with an index."""
        return {index: position for position, index in enumerate(self.dataset.rows.column("index"))}

    @cached_property
    def judge(self) -> Judge:
        """Runs programs on the data set's scenes."""
        return Judge(self.dataset)

    def task_features(self, positions: Sequence[int], pairs: Any = slice(EXAMPLES)) -> torch.Tensor:
        """The features of tasks, float32 ``[task, pair, 2, feature]``, on the device.

        Args:
            positions: of the tasks.
            pairs: which examples: a slice for all of them, or rows ``[task, pair]``.
        """
        return features_of(self.features, positions, pairs)

    def given(self, model: Synthesizer, positions: Sequence[int], pairs: Any = slice(EXAMPLES)) -> Any:
        """What a synthesizer is told of tasks: its ways if it acts, else features (`task_features`)."""
        if model.acts:
            assert self.ways is not None, "ways are recorded before anything is learned from them"
            ways, row_of = self.ways
            return ways.batch([row_of[p] for p in positions], device())
        return self.task_features(positions, pairs)

    def beam(self, model: Synthesizer, positions: Sequence[int], beam: int) -> Iterator[list[Program]]:
        """The synthesizer's programs for tasks, from their five specification examples, best first."""
        for start in range(0, len(positions), DECODED_TOGETHER):
            given = self.given(model, positions[start : start + DECODED_TOGETHER])
            with autocast():
                proposals = beam_search(model, given, beam)
            yield from ([p.program for p in group] for group in proposals)

    def made_from(self, model: Any, sizes: Sequence[str], *checkpoints: str) -> dict[str, Any]:
        """All that a training depends on: sizes of its scale, its data, the model, what it starts from.

        Args:
            model: what is trained.
            sizes: the fields of Scale that are read, other than those that FitConfig repeats.
            checkpoints: whose weights it uses.
        """
        return {
            "sizes": {name: getattr(self.scale, name) for name in sizes},
            "dataset": self.dataset.identity,
            "model": asdict(model.config),
            "checkpoints": {name: hash_of(self.out / name) for name in checkpoints},
        }

    def start_from_pairs(self, model: torch.nn.Module) -> None:
        """The embedding of pairs starts from the inverse model's, which has seen far more pairs."""
        start_pairs(model, load_inverse(self.out / "inverse").pair.state_dict())

    def save(
        self,
        model: torch.nn.Module,
        name: str,
        config: FitConfig,
        metrics: dict[str, float],
        made_from: dict[str, Any],
        **more: Any,
    ) -> Path:
        """Write a checkpoint, with the facts of its making.

        Args:
            model: its weights and configuration.
            name: of its folder.
            config: how it was fitted.
            metrics: how good it is on validation data.
            made_from: what `made_from` has said.
            more: further facts.
        """
        facts = {
            "scale": self.scale_name,
            "seed": self.seed,
            "dataset": self.dataset.identity,
            "fit": asdict(config),
            "sizes": made_from["sizes"],
            "made_from": made_from["checkpoints"],
            "metrics": {key: round(value, 5) for key, value in metrics.items()},
            "commit": self._commit,
            "evaps": version("evaps"),
            "torch": torch.__version__,
            "cores": os.cpu_count(),
            "precision": precision(),
            **more,
            "minutes_of_last_run": round((time.monotonic() - self._start) / 60, 1),
        }
        if self._processes.is_main_process:
            save_checkpoint(self.out / name, model, name, facts)
        return self.out / name
