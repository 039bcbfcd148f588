"""What repairers learn from: mutations of gold programs, and then the synthesizer's own failures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from evaps.dsl import VOCAB, Program
from evaps.models import PROPOSER, load_method
from evaps.models.base import Repairer, Synthesizer
from evaps.models.checkpoint import hash_of
from evaps.models.compute import device
from evaps.synthesis.mistakes import Mistakes, generate_mistakes
from evaps.tasks.identity import short_hash
from evaps.train.batches import batch_at
from evaps.train.loop import FitConfig, Share, fit
from evaps.train.run import Run

VALIDATION_REPAIRS = 512
SIZES = ("mistake_tasks", "mutations", "failures", "repairer_steps", "repairer_batch")


def train_repairer(run: Run, model: Repairer) -> Path:
    """Cross-entropy of the edits that lead to the gold program: SED's two stages (Gupta et al., 2020)."""
    run.start_from_pairs(model)
    train, held = (find_mistakes(run, split) for split in ("train", "validation"))
    first, second = run.scale.repairer_steps
    config = FitConfig(
        first + second, rate=1e-3, seed=run.seed, validate_every=300, patience=run.scale.patience
    )
    made_from = run.made_from(model, SIZES, "encoder", "inverse", PROPOSER)
    stages = [np.flatnonzero(np.array(train.stages) == stage) for stage in (1, 2)]
    lengths = [[len(train.targets[i].tokens) for i in stage] for stage in stages]
    orders = [batch_at(sizes, run.scale.repairer_batch, run.seed) for sizes in lengths]
    table, held_table = (torch.from_numpy(m.table).to(device()) for m in (train, held))

    def loss_at(step: int, share: Share) -> tuple[Tensor, dict[str, float]]:
        stage = int(step >= first)
        chosen = stages[stage][orders[stage](step)]
        return mistake_loss(model, train, share.of(chosen), table), {}

    def validate() -> dict[str, float]:
        likelihood, shares = -_mean_loss(model, held, held_table), _repairs(run, model, held, held_table)
        # as with synthesizers: of some 500 failures twenty are mended, which jumps by five of them
        return {"likelihood": likelihood, **shares, "score": shares["semantic"] + likelihood}

    folder = run.out / model.name
    metrics = fit(model, loss_at, config, folder, validate, "score", made_from, run.tensorboard)
    return run.save(model, model.name, config, metrics, made_from)


def find_mistakes(run: Run, split: str) -> Mistakes:
    """Mutations and the synthesizer's failures on tasks of a split, run and embedded once."""
    scale = run.scale
    tasks = scale.mistake_tasks if split == "train" else max(10, scale.mistake_tasks // 25)
    positions = run.dataset.split(split)[:tasks]
    synthesizer = load_method(run.out / PROPOSER, PROPOSER).to(device())
    assert isinstance(synthesizer, Synthesizer)
    parents = [hash_of(run.out / name) for name in ("encoder", PROPOSER)]
    key = short_hash([parents, run.seed, scale.mutations, scale.failures, tasks])
    folder = run.dataset.folder / f"mistakes-{split}-{key}"
    synthesizer.train()  # with dropout, since it knows these tasks better than any that it will meet

    def failures(part: Sequence[int]) -> list[list[str]]:
        torch.manual_seed(run.seed * 1_000_003 + part[0])  # the same, wherever this was interrupted
        beams = run.beam(synthesizer, part, max(8, scale.failures))
        return [_wrong(run, task, beam) for task, beam in zip(part, beams, strict=True)]

    encoder = run.out / "encoder"
    run.load_features()
    with run.main_process_first():
        paths = generate_mistakes(
            folder, run.dataset, encoder, positions, failures, scale.mutations, run.seed, run.workers
        )
    return Mistakes.read(paths)


def _wrong(run: Run, position: int, programs: Sequence[Program]) -> list[str]:
    gold = " ".join(VOCAB.decode(run.programs[position]))
    return [str(p) for p in programs if str(p) != gold][: run.scale.failures]


def mistake_loss(model: Repairer, mistakes: Mistakes, rows: Iterable[int], table: Tensor) -> Tensor:
    """The repairer's loss on the chosen mistakes."""
    return model.batch_loss(*mistake_batch(model, mistakes, rows, table))


def mistake_batch(
    model: Repairer, mistakes: Mistakes, rows: Iterable[int], table: Tensor
) -> tuple[Any, Tensor]:
    """The chosen mistakes as the repairer's tensors, and those embeddings that they use, in float32."""
    chosen = list(rows)
    executions = [mistakes.executions[i] for i in chosen]
    used = np.unique(np.concatenate([seen.ravel() for e in executions for seen in e.rows()]))
    used = used[used >= 0]
    small = [e.renumbered(used) for e in executions]
    batch = model.batch(small, [mistakes.targets[i] for i in chosen], table.device)
    return batch, table[torch.from_numpy(used).to(table.device)].float()


def _mean_loss(model: Repairer, mistakes: Mistakes, table: Tensor) -> float:
    parts = [range(i, min(i + 64, len(mistakes.targets))) for i in range(0, len(mistakes.targets), 64)]
    return float(np.mean([mistake_loss(model, mistakes, list(part), table).item() for part in parts]))


def _repairs(run: Run, model: Repairer, mistakes: Mistakes, table: Tensor) -> dict[str, float]:
    """The shares of the synthesizer's failures that one repair makes semantically, and exactly, right."""
    rows = [i for i, stage in enumerate(mistakes.stages) if stage == 2][:VALIDATION_REPAIRS]
    if not rows:
        return {"semantic": 0.0, "exact": 0.0}
    repaired: list[Program | None] = []
    for start in range(0, len(rows), 64):
        executions = [mistakes.executions[i] for i in rows[start : start + 64]]
        repaired += model.repair(executions, table.float(), [{e.program} for e in executions])
    positions = [run.position_of[mistakes.tasks[i]] for i in rows]
    exact = [r == mistakes.targets[i] for i, r in zip(rows, repaired, strict=True)]
    return {"semantic": run.judge.share_right(positions, repaired), "exact": float(np.mean(exact))}
