"""What each method learns from, and the checkpoint that comes out."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from evaps.dsl import VOCAB, GrammarState, Program, UserError
from evaps.dsl.sampler import MAX_TOKENS
from evaps.models import PROPOSER, is_repairer, load_encoder, load_method, new_method
from evaps.models.base import Repairer, Synthesizer, pad
from evaps.models.beam import beam_search
from evaps.models.checkpoint import CheckpointError, hash_of, load_weights, read_config, save_checkpoint
from evaps.models.compute import autocast, device, precision
from evaps.models.encoder import EncoderConfig, TransitionModel
from evaps.robots.base import Scene
from evaps.robots.workers import TWO, Workers
from evaps.synthesis.features import dataset_features
from evaps.synthesis.mistakes import TASKS, Mistakes, generate_mistakes
from evaps.tasks.dataset import Dataset
from evaps.tasks.identity import code_version, short_hash
from evaps.tasks.progress import track
from evaps.tasks.task import EXAMPLES
from evaps.tasks.walks import Walks, generate_walks
from evaps.train import encoder as stage0
from evaps.train.batches import batch_at
from evaps.train.loop import FitConfig, fit
from evaps.train.scale import SCALES, Scale

VALIDATION_TASKS = 512


def train(
    method: str,
    data: Path,
    out: Path,
    scale: str = "small",
    seed: int = 0,
    workers: Workers = TWO,
) -> Path:
    """Train a method, or go on with it; needs what comes before it: encoder, synthesizer, repairer.

    Args:
        method: ``"encoder"`` or a name in METHODS.
        data: folder of a data set.
        out: folder of the checkpoints; each method gets a folder in it.
        scale: a name in SCALES.
        seed: of everything random in the training.
        workers: who simulates.

    Returns:
        the checkpoint's folder.

    Raises:
        UserError: an unknown method or scale, no data set, or other settings than those it was begun with.
        CheckpointError: what comes before it is missing.
    """
    if scale not in SCALES:
        raise UserError(f"there is no scale {scale!r}; known are {', '.join(SCALES)}")
    run = _Run(Dataset(data), out, SCALES[scale], scale, seed, workers)
    if method == "encoder":
        return run.train_encoder()
    for needed in ("encoder", PROPOSER) if is_repairer(method) else ("encoder",):
        if not (out / needed / "config.json").exists():
            first = f"evaps train {needed} --data {data} --out {out}"
            raise CheckpointError(f"{method} needs the checkpoint of {needed} in {out}; first: {first}")
    torch.manual_seed(seed)
    model = new_method(method).to(device())
    if isinstance(model, Synthesizer):
        return run.train_synthesizer(model)
    return run.train_repairer(model)


class _Run:
    def __init__(
        self, dataset: Dataset, out: Path, scale: Scale, scale_name: str, seed: int, workers: Workers
    ) -> None:
        self.dataset, self.out, self.scale, self.seed, self.workers = dataset, out, scale, seed, workers
        self.scale_name = scale_name
        self.start, self.commit = time.monotonic(), code_version()

    def train_encoder(self) -> Path:
        train = self.dataset.split("train")[: self.scale.task_walks]
        rows = (self.dataset.rows[p] for p in train)
        starts = [_start(row, row["index"] % EXAMPLES) for row in rows]
        folder = self.dataset.folder / "walks"
        paths = generate_walks(folder, self.scale.walks, self.seed, self.workers, starts)
        torch.manual_seed(self.seed)
        model = TransitionModel(EncoderConfig()).to(device())
        batches = stage0.WalkBatches(Walks.read(paths), self.scale.encoder_batch, self.seed)
        config = FitConfig(self.scale.encoder_steps, rate=1e-3, seed=self.seed)
        loss_at = stage0.encoder_loss(model, batches)
        metrics = fit(
            model,
            loss_at,
            config,
            self.out / "encoder",
            stage0.validate(model, batches),
            500,
            "counts",
            self._made_from(model),
        )
        self._save(model.pair, "pair", config, metrics)
        return self._save(model.encoder, "encoder", config, metrics)

    def train_synthesizer(self, model: Synthesizer) -> Path:
        self._start_from_pairs(model)
        batch = self.scale.lgrl_batch
        config = FitConfig(self.scale.lgrl_steps, rate=1e-3, seed=self.seed)
        made_from = self._made_from(model, "encoder", "pair")
        train, held = self.dataset.split("train"), self.dataset.split("validation")[:VALIDATION_TASKS]
        rows_at = batch_at([len(self._programs[p]) for p in train], batch, self.seed)
        masks = {p: grammar_masks(self._programs[p]) for p in [*train, *held]}

        def loss_of(positions: Sequence[int], pairs: np.ndarray[Any, Any]) -> Tensor:
            tokens = pad([self._programs[p] for p in positions])
            allowed = np.zeros((*tokens.shape, len(VOCAB)), bool)
            for row, p in zip(allowed, positions, strict=True):
                row[: len(masks[p])] = masks[p]
            chosen = self._features[np.asarray(positions)[:, None], pairs].astype(np.float32)
            where = device()
            return model.loss(
                torch.from_numpy(chosen).to(where), tokens.to(where), torch.from_numpy(allowed).to(where)
            )

        def loss_at(step: int) -> tuple[Tensor, dict[str, float]]:
            positions = [train[i] for i in rows_at(step)]
            rng = np.random.default_rng([self.seed, 3, step])
            pairs = rng.permuted(np.tile(np.arange(EXAMPLES + 1), (len(positions), 1)), axis=1)
            return loss_of(positions, pairs[:, :EXAMPLES]), {}  # the pair left out rotates

        def validate() -> dict[str, float]:
            first_five = np.tile(np.arange(EXAMPLES), (batch, 1))
            parts = [held[i : i + batch] for i in range(0, len(held), batch)]
            losses = [loss_of(p, first_five[: len(p)]).item() for p in parts]
            return {"loss": float(np.mean(losses)), "exact": self._exact(model, held)}

        metrics = fit(model, loss_at, config, self.out / model.name, validate, 250, "exact", made_from)
        return self._save(model, model.name, config, metrics)

    def train_repairer(self, model: Repairer) -> Path:
        self._start_from_pairs(model)
        train, held = (self._mistakes(s) for s in ("train", "validation"))
        first, second = self.scale.evaps_steps
        config = FitConfig(first + second, rate=1e-3, seed=self.seed)
        made_from = self._made_from(model, "encoder", "pair", PROPOSER)
        stages = [np.flatnonzero([s == stage for s in train.stages]) for stage in (1, 2)]
        lengths = [[len(train.targets[i].tokens) for i in stage] for stage in stages]
        orders = [batch_at(sizes, self.scale.evaps_batch, self.seed) for sizes in lengths]
        table, held_table = (torch.from_numpy(m.table).to(device()) for m in (train, held))

        def loss_at(step: int) -> tuple[Tensor, dict[str, float]]:
            stage = int(step >= first)
            chosen = stages[stage][orders[stage](step)]
            return mistake_loss(model, train, chosen, table), {}

        def validate() -> dict[str, float]:
            likelihood = -_mean_loss(model, held, held_table)  # steadier than exact repairs, which are few
            return {"likelihood": likelihood, "exact": _exact_repairs(model, held, held_table)}

        metrics = fit(model, loss_at, config, self.out / model.name, validate, 500, "likelihood", made_from)
        return self._save(model, model.name, config, metrics)

    @cached_property
    def _programs(self) -> list[list[int]]:
        return [VOCAB.encode(program.split()) for program in self.dataset.rows.column("program")]

    @cached_property
    def _features(self) -> np.ndarray[Any, np.dtype[np.float16]]:
        """Of every example's first and last observation, ``[task, pair, 2, feature]``."""
        folder = self.out / "encoder"
        return dataset_features(self.dataset, load_encoder(folder).to(device()), hash_of(folder))

    def _made_from(self, model: Any, *checkpoints: str) -> dict[str, Any]:
        """All that a training depends on: its scale, its data, the model's sizes and what it starts from."""
        hashes = {name: hash_of(self.out / name) for name in checkpoints}
        return {
            "scale": asdict(self.scale),
            "dataset": self.dataset.identity,
            "model": asdict(model.config),
            "checkpoints": hashes,
        }

    def _start_from_pairs(self, model: torch.nn.Module) -> None:
        """The embedding of pairs starts from stage 0's, which has seen far more pairs than there are."""
        folder = self.out / "pair"
        read_config(folder, "pair")
        load_weights(folder, model.get_submodule("pair"))

    def _beam(self, model: Synthesizer, positions: Sequence[int], beam: int) -> Iterator[list[Program]]:
        """The synthesizer's programs for tasks of the data set, from their five specification examples."""
        for part in (positions[i : i + 16] for i in range(0, len(positions), 16)):
            features = torch.from_numpy(self._features[np.asarray(part), :EXAMPLES].astype(np.float32))
            with autocast():
                proposals = beam_search(model, features.to(device()), beam)
            yield from ([p.program for p in group] for group in proposals)

    def _exact(self, model: Synthesizer, positions: Sequence[int]) -> float:
        best = self._beam(model, positions, 4)
        golds = [self._programs[p] for p in positions]
        right = [VOCAB.encode(b[0].tokens) == gold for b, gold in zip(best, golds, strict=True) if b]
        return sum(right) / len(positions)

    def _mistakes(self, split: str) -> Mistakes:
        """Mutations and the synthesizer's failures on tasks of a split, run and embedded once."""
        scale = self.scale
        tasks = scale.mistake_tasks if split == "train" else max(10, scale.mistake_tasks // 25)
        positions = self.dataset.split(split)[:tasks]
        synthesizer = load_method(self.out / PROPOSER, PROPOSER).to(device())
        assert isinstance(synthesizer, Synthesizer)
        parents = [hash_of(self.out / name) for name in ("encoder", PROPOSER)]
        key = short_hash([parents, self.seed, scale.mutations, scale.failures, tasks])
        folder = self.dataset.folder / f"mistakes-{split}-{key}"
        failures: dict[int, list[str]] = {}
        if len(list(folder.glob("*.parquet"))) < -(-len(positions) // TASKS):
            torch.manual_seed(self.seed)
            synthesizer.train()  # with dropout, since it knows these tasks better than any that it will meet
            beams = self._beam(synthesizer, positions, max(8, scale.failures))
            beams = track(beams, len(positions), "proposals")
            failures = {p: self._wrong(p, b) for p, b in zip(positions, beams, strict=True)}
        encoder = self.out / "encoder"
        paths = generate_mistakes(
            folder, self.dataset, encoder, positions, failures, scale.mutations, self.seed, self.workers
        )
        return Mistakes.read(paths)

    def _wrong(self, position: int, programs: Sequence[Program]) -> list[str]:
        gold = " ".join(VOCAB.decode(self._programs[position]))
        return [str(p) for p in programs if str(p) != gold][: self.scale.failures]

    def _save(self, model: torch.nn.Module, name: str, config: FitConfig, metrics: dict[str, float]) -> Path:
        facts = {
            "scale": self.scale_name,
            "seed": self.seed,
            "dataset": self.dataset.identity,
            "fit": asdict(config),
            "metrics": {key: round(value, 5) for key, value in metrics.items()},
            "commit": self.commit,
            "evaps": version("evaps"),
            "torch": torch.__version__,
            "cores": os.cpu_count(),
            "precision": precision(),
            "minutes_of_last_run": round((time.monotonic() - self.start) / 60, 1),
        }
        save_checkpoint(self.out / name, model, name, facts)
        return self.out / name


def _start(row: dict[str, Any], example: int) -> tuple[Scene, tuple[str, ...]]:
    return Scene.from_json(row["scenes"][example]), tuple(row["actions"][example].split())


def grammar_masks(tokens: Sequence[int]) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """For every token of a program, what the grammar allowed there, ``[token, vocab]``."""
    state = GrammarState.start()
    masks = []
    for i, token in enumerate(tokens):
        masks.append(state.allowed_within(MAX_TOKENS - i))
        state = state.advance(token)
    return np.stack(masks)


def mistake_loss(model: Repairer, mistakes: Mistakes, rows: Iterable[int], table: Tensor) -> Tensor:
    """The repairer's loss on the chosen mistakes; only the embeddings that they use are taken along."""
    executions = [mistakes.executions[i] for i in rows]
    used = np.unique(np.concatenate([rows.ravel() for e in executions for rows in e.rows()]))
    used = used[used >= 0]
    small = [e.renumbered(used) for e in executions]
    targets = [mistakes.targets[i] for i in rows]
    return model.loss(small, targets, table[torch.from_numpy(used).to(table.device)].float())


def _mean_loss(model: Repairer, mistakes: Mistakes, table: Tensor) -> float:
    parts = [range(i, min(i + 64, len(mistakes.targets))) for i in range(0, len(mistakes.targets), 64)]
    return float(np.mean([mistake_loss(model, mistakes, list(part), table).item() for part in parts]))


def _exact_repairs(model: Repairer, mistakes: Mistakes, table: Tensor) -> float:
    """The share of the synthesizer's failures that one repair turns into the right program."""
    rows = [i for i, stage in enumerate(mistakes.stages) if stage == 2][:256]
    executions = [mistakes.executions[i] for i in rows]
    repaired = model.repair(executions, table.float(), [{e.program} for e in executions])
    return float(np.mean([r == mistakes.targets[i] for i, r in zip(rows, repaired, strict=True)]))
