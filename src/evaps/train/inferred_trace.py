"""How Inferred Trace learns: a policy from the gold programs' ways, then programs from the policy's ways."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from torch import Tensor

from evaps.models.checkpoint import hash_of
from evaps.models.compute import device
from evaps.models.inferred_trace import InferredTrace
from evaps.synthesis.recordings import record_ways
from evaps.synthesis.ways import WayTable
from evaps.tasks.identity import short_hash
from evaps.train.batches import batch_at
from evaps.train.loop import FitConfig, Share, fit
from evaps.train.run import Run
from evaps.train.synthesizers import VALIDATION_TASKS, fit_likelihood

POLICY_BATCH = 16  # tasks, with five ways each


def train_inferred_trace(run: Run, model: InferredTrace) -> Path:
    """Shin et al., 2018: the decoder learns from ways that the policy went, as it will meet them."""
    run.start_from_pairs(model)
    train = run.dataset.split("train")
    held = run.dataset.split("validation")[:VALIDATION_TASKS]
    made_from = run.made_from(model, ("policy_tasks", "synthesizer_batch"), "encoder", "inverse")
    first = _fit_policy(run, model, train[: run.scale.policy_tasks], held, made_from)
    weights = run.out / model.name / "policy" / "best.pt"
    positions = [*train, *held]
    ways = _ways(run, model, positions, weights)
    run.ways = ways, {position: row for row, position in enumerate(positions)}
    config = FitConfig(
        run.scale.synthesizer_steps, 1e-3, run.seed, validate_every=500, patience=run.scale.patience
    )
    targets = [run.programs[p] for p in train]
    metrics = fit_likelihood(
        run, model, train, targets, config, run.out / model.name, {**made_from, "policy": first}
    )
    reached = {
        "policy_reaches_in_training": float(ways.reached[: len(train)].mean()),
        "policy_reaches": float(ways.reached[len(train) :].mean()),
    }
    policy = {f"policy_{key.removeprefix('validation_policy_')}": value for key, value in first.items()}
    return run.save(model, model.name, config, {**metrics, **policy, **reached}, made_from)


def _fit_policy(
    run: Run, model: InferredTrace, train: Sequence[int], held: Sequence[int], made_from: dict[str, Any]
) -> dict[str, float]:
    """Likelihood of what the gold programs do; the model ends with the policy's best weights."""
    policy = model.policy
    table, held_table = (_ways(run, model, positions) for positions in (train, held))
    config = FitConfig(run.scale.policy_steps, rate=1e-3, seed=run.seed, validate_every=500)
    lengths = (table.rows >= 0).sum((1, 2)).tolist()
    rows_at = batch_at(lengths, POLICY_BATCH, run.seed)

    def loss_at(step: int, share: Share) -> tuple[Tensor, dict[str, float]]:
        return policy.loss(table.batch(share.of(rows_at(step)).tolist(), device()))[0], {}

    def validate() -> dict[str, float]:
        parts = [range(start, min(start + 64, len(held))) for start in range(0, len(held), 64)]
        losses = [policy.loss(held_table.batch(list(part), device())) for part in parts]
        loss, right = (float(np.mean([pair[i].item() for pair in losses])) for i in range(2))
        return {"policy_likelihood": -loss, "policy_right": right}

    folder = run.out / model.name / "policy"
    return fit(policy, loss_at, config, folder, validate, "policy_likelihood", made_from, run.tensorboard)


def _ways(run: Run, model: InferredTrace, positions: Sequence[int], policy: Path | None = None) -> WayTable:
    encoder = run.out / "encoder"
    who = "" if policy is None else policy.read_bytes().hex()
    key = short_hash([hash_of(encoder), list(positions), who])
    folder = run.dataset.folder / f"ways-{'gold' if policy is None else 'policy'}-{key}"
    with run.main_process_first():
        ways = record_ways(folder, run.dataset, encoder, positions, run.workers, model.config, policy)
    return replace(ways, table=ways.table.to(device()))
