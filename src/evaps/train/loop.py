"""The training loop: seeded, resumable at any moment, with its metrics in a file."""

from __future__ import annotations

import io
import json
import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from evaps.dsl import UserError
from evaps.files import write_atomically
from evaps.models.compute import autocast
from evaps.tasks.progress import track

LossAt = Callable[[int], tuple[Tensor, dict[str, float]]]


@dataclass(frozen=True)
class FitConfig:
    """How a model is fitted."""

    steps: int
    """Batches in all."""
    rate: float
    """The highest learning rate of Adam."""
    seed: int = 0
    """Of the batches and of dropout."""
    warmup: int = 100
    """Batches over which the rate rises; then it falls along a cosine to a fiftieth."""
    clip: float = 1.0
    """The largest norm of the gradient."""
    log_every: int = 50
    """Batches between two rows of metrics."""
    save_every: float = 60.0
    """Seconds between two saves."""


def rate_at(step: int, config: FitConfig) -> float:
    """The learning rate of a step."""
    rise = min(1.0, (step + 1) / config.warmup)
    fall = 0.5 * (1 + math.cos(math.pi * step / config.steps))
    return config.rate * rise * (0.02 + 0.98 * fall)


def fit(
    model: nn.Module,
    loss_at: LossAt,
    config: FitConfig,
    folder: Path,
    validate: Callable[[], dict[str, float]],
    validate_every: int,
    select: str,
    made_from: dict[str, Any] | None = None,
) -> dict[str, float]:
    """Minimise ``loss_at(step)``; stopped at any moment, the same call goes on with the same result.

    Args:
        model: its parameters are trained in place.
        loss_at: the loss of a step's batch, which must depend on nothing but the step, and metrics to log.
        config: how.
        folder: gets ``state.pt`` (to go on from) and ``metrics.jsonl``.
        validate: metrics on held-out data.
        validate_every: steps between two validations; there is one more at the end.
        select: which of these metrics should be high; the model ends with the weights of its best time.
        made_from: all else that the result depends on, as JSON values; other settings do not go on with it.

    Returns:
        the metrics of that time.

    Raises:
        UserError: the folder holds a training with other settings.
    """
    folder.mkdir(parents=True, exist_ok=True)
    settings = json.dumps({**asdict(config), **(made_from or {})}, sort_keys=True)
    optimizer = torch.optim.Adam(model.parameters(), lr=config.rate)
    start, metrics = _resume(folder, model, optimizer, settings)
    saved = time.monotonic()
    for step in track(range(start, config.steps), config.steps, folder.name, start):
        metrics_now = _step(model, optimizer, loss_at, config, step)
        last = step + 1 == config.steps
        validated = (step + 1) % validate_every == 0 or last
        if validated:
            found = _validated(model, validate)
            metrics_now |= found
            if found[f"validation_{select}"] > metrics.get(f"validation_{select}", -math.inf):
                metrics = {"best_step": step, **found}
                _write(model.state_dict(), folder / "best.pt")
        if step % config.log_every == 0 or validated:
            _log(folder, {"step": step, **metrics_now})
        if time.monotonic() - saved > config.save_every or last:
            state = {"model": model.state_dict(), "optimizer": optimizer.state_dict(), "step": step + 1}
            _write({**state, "metrics": metrics, "settings": settings}, folder / "state.pt")
            saved = time.monotonic()
    model.load_state_dict(torch.load(folder / "best.pt", weights_only=True))
    model.eval()
    return metrics


def _step(
    model: nn.Module, optimizer: torch.optim.Adam, loss_at: LossAt, config: FitConfig, step: int
) -> dict[str, float]:
    model.train()
    torch.manual_seed(config.seed * 1_000_003 + step)  # so that dropout is the same after a restart
    for group in optimizer.param_groups:
        group["lr"] = rate_at(step, config)
    with autocast():
        loss, metrics = loss_at(step)
    optimizer.zero_grad()
    loss.backward()
    norm = nn.utils.clip_grad_norm_(model.parameters(), config.clip)
    optimizer.step()
    return {"loss": loss.item(), "norm": norm.item(), **metrics}


def _validated(model: nn.Module, validate: Callable[[], dict[str, float]]) -> dict[str, float]:
    model.eval()
    with torch.inference_mode(), autocast():
        return {f"validation_{key}": value for key, value in validate().items()}


def _log(folder: Path, row: dict[str, Any]) -> None:
    with (folder / "metrics.jsonl").open("a") as file:
        file.write(json.dumps({key: round(value, 5) for key, value in row.items()}) + "\n")


def _write(state: dict[str, Any], path: Path) -> None:
    content = io.BytesIO()
    torch.save(state, content)
    write_atomically(path, content.getvalue())


def _resume(
    folder: Path, model: nn.Module, optimizer: torch.optim.Adam, settings: str
) -> tuple[int, dict[str, float]]:
    if not (folder / "state.pt").exists():
        return 0, {}
    state = torch.load(folder / "state.pt", weights_only=True)
    if state.get("settings") != settings:
        raise UserError(f"{folder} holds a training with other settings; delete it or use another folder")
    model.load_state_dict(state["model"])
    optimizer.load_state_dict(state["optimizer"])
    return int(state["step"]), state["metrics"]
