"""The training loop: seeded, resumable at any moment, on one device or several, with metrics in a file."""

from __future__ import annotations

import io
import json
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import torch
from accelerate import Accelerator
from torch import Tensor, nn

from evaps.dsl import UserError
from evaps.files import write_atomically
from evaps.models.compute import device, half_pays
from evaps.tasks.progress import track

Rows = TypeVar("Rows")


@dataclass(frozen=True)
class Share:
    """Which part of each batch is this process's, where several processes train together."""

    index: int = 0
    count: int = 1

    def of(self, rows: Rows) -> Rows:
        """Every ``count``-th row."""
        mine: Rows = rows[self.index :: self.count]  # type: ignore[index]
        return mine


START_ANEW = "delete the folder, and train with another seed"

LossAt = Callable[[int, Share], tuple[Tensor, dict[str, float]]]
"""The loss of a step's batch (of a share of it), and metrics to log; it depends on nothing else."""


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
    validate_every: int = 250
    """Batches between two validations; there is one more at the end."""
    patience: int = 0
    """Validations without an improvement after which the training stops; 0 for never."""
    log_every: int = 50
    """Batches between two rows of metrics."""
    save_every: float = 60.0
    """Seconds between two saves."""


def rate_at(step: int, config: FitConfig) -> float:
    """The learning rate of a step."""
    rise = min(1.0, (step + 1) / config.warmup)
    fall = 0.5 * (1 + math.cos(math.pi * step / config.steps))
    return config.rate * rise * (0.02 + 0.98 * fall)


@dataclass
class Progress:
    """How far a training is.

    Attributes:
        step: the next batch.
        stale: validations since the best one.
        best: the metrics of the best one.
    """

    step: int = 0
    stale: int = 0
    best: dict[str, float] = field(default_factory=dict)


def fit(
    model: nn.Module,
    loss_at: LossAt,
    config: FitConfig,
    folder: Path,
    validate: Callable[[], dict[str, float]],
    select: str,
    made_from: dict[str, Any] | None = None,
    tensorboard: bool = False,
    keep_start: bool = False,
) -> dict[str, float]:
    """Minimise ``loss_at(step, share)``; stopped at any moment, the same call goes on with the same result.

    Precision and devices are accelerate's: bfloat16 where it pays, and under ``accelerate launch`` each
    process works on its share of every batch, and the gradients are averaged.

    Args:
        model: its parameters are trained in place.
        loss_at: the loss of a step's batch.
        config: how.
        folder: gets ``state.pt`` (to go on from), ``best.pt`` and ``metrics.jsonl``.
        validate: metrics on held-out data.
        select: which of these metrics should be high; the model ends with the weights of its best time.
        made_from: all else that the result depends on, as JSON values; other settings do not go on with it.
        tensorboard: write the metrics for TensorBoard too.
        keep_start: validate the weights that it starts from, too, as step -1: they stay if nothing is better.

    Returns:
        the metrics of that time.

    Raises:
        UserError: the folder holds a training with other settings, there is no TensorBoard, or a validation's
            result is no number.
    """
    folder.mkdir(parents=True, exist_ok=True)
    accelerator = _accelerator(folder, tensorboard)
    settings = json.dumps({**asdict(config), **(made_from or {})}, sort_keys=True)
    optimizer = torch.optim.Adam(model.parameters(), lr=config.rate)
    progress = _resume(folder, model, optimizer, settings)
    at_start = keep_start and not progress.best
    _unlog(folder, -1 if at_start else progress.step, accelerator)
    if at_start:
        found = _validated(model, validate, accelerator, select, folder)
        _keep(progress, -1, found, model, folder, accelerator)
        _log(folder, {"step": -1, **found}, accelerator)
    saved = time.monotonic()
    for step in track(_steps(progress, config), config.steps, folder.name, progress.step):
        metrics = _step(model, optimizer, loss_at, config, step, accelerator)
        progress.step = step + 1
        last = progress.step == config.steps
        if validated := last or progress.step % config.validate_every == 0:
            metrics |= (found := _validated(model, validate, accelerator, select, folder))
            progress.stale += 1
            if found[f"validation_{select}"] > progress.best.get(f"validation_{select}", -math.inf):
                _keep(progress, step, found, model, folder, accelerator)
        if step % config.log_every == 0 or validated:
            _log(folder, {"step": step, **metrics}, accelerator)
        if time.monotonic() - saved > config.save_every or validated:
            state = {"model": model.state_dict(), "optimizer": optimizer.state_dict()}
            _write({**state, **asdict(progress), "settings": settings}, folder / "state.pt", accelerator)
            saved = time.monotonic()
    accelerator.end_training()
    accelerator.wait_for_everyone()
    model.load_state_dict(torch.load(folder / "best.pt", map_location=device(), weights_only=True))
    model.eval()
    return progress.best


def _accelerator(folder: Path, tensorboard: bool) -> Accelerator:
    try:
        accelerator = Accelerator(
            cpu=device().type == "cpu",
            mixed_precision="bf16" if half_pays() else "no",
            log_with="tensorboard" if tensorboard else None,
            project_dir=folder,
        )
        accelerator.init_trackers("tensorboard")
    except (ImportError, ValueError) as error:
        if tensorboard:
            raise UserError("there is no TensorBoard; try: pip install 'evaps[track]'") from error
        raise
    return accelerator


def _steps(progress: Progress, config: FitConfig) -> Iterator[int]:
    """The steps that are left, until nothing gets better any more."""
    while progress.step < config.steps and not (config.patience and progress.stale >= config.patience):
        yield progress.step


def _step(
    model: nn.Module,
    optimizer: torch.optim.Adam,
    loss_at: LossAt,
    config: FitConfig,
    step: int,
    accelerator: Accelerator,
) -> dict[str, float]:
    model.train()
    share = Share(accelerator.process_index, accelerator.num_processes)
    torch.manual_seed(config.seed * 1_000_003 + step + 999_983 * share.index)  # the same after a restart
    for group in optimizer.param_groups:
        group["lr"] = rate_at(step, config)
    with accelerator.autocast():
        loss, metrics = loss_at(step, share)
    optimizer.zero_grad()
    accelerator.backward(loss)
    if share.count > 1:
        for parameter in model.parameters():
            if parameter.grad is None:  # a part that this share has no use for
                parameter.grad = torch.zeros_like(parameter)
            parameter.grad = accelerator.reduce(parameter.grad, "mean")
    norm = nn.utils.clip_grad_norm_(model.parameters(), config.clip)
    optimizer.step()
    return {"loss": loss.item(), "norm": norm.item(), **metrics}


def _validated(
    model: nn.Module,
    validate: Callable[[], dict[str, float]],
    accelerator: Accelerator,
    select: str,
    folder: Path,
) -> dict[str, float]:
    model.eval()
    with torch.inference_mode(), accelerator.autocast():
        found = {f"validation_{key}": value for key, value in validate().items()}
    if math.isnan(found[f"validation_{select}"]):
        raise UserError(f"{folder} has diverged: its {select} is no number; {START_ANEW}")
    return found


def _keep(
    progress: Progress,
    step: int,
    found: dict[str, float],
    model: nn.Module,
    folder: Path,
    accelerator: Accelerator,
) -> None:
    """These are the best weights so far."""
    progress.best, progress.stale = {"best_step": step, **found}, 0
    _write(model.state_dict(), folder / "best.pt", accelerator)


def _log(folder: Path, row: dict[str, Any], accelerator: Accelerator) -> None:
    accelerator.log(row, step=row["step"])
    if accelerator.is_main_process:
        with (folder / "metrics.jsonl").open("a") as file:
            file.write(json.dumps({key: round(value, 5) for key, value in row.items()}) + "\n")


def _unlog(folder: Path, step: int, accelerator: Accelerator) -> None:
    """Take back the metrics from a step on, since it is done again; the last row may have been cut off."""
    path = folder / "metrics.jsonl"
    if accelerator.is_main_process and path.exists():
        rows = [row for row in path.read_text().splitlines(keepends=True) if row.endswith("\n")]
        kept = "".join(row for row in rows if json.loads(row)["step"] < step)
        write_atomically(path, kept.encode())


def _write(state: dict[str, Any], path: Path, accelerator: Accelerator) -> None:
    if accelerator.is_main_process:
        content = io.BytesIO()
        torch.save(state, content)
        write_atomically(path, content.getvalue())


def _resume(folder: Path, model: nn.Module, optimizer: torch.optim.Adam, settings: str) -> Progress:
    if not (folder / "state.pt").exists():
        return Progress()
    state = torch.load(folder / "state.pt", map_location=device(), weights_only=True)
    if state.get("settings") != settings:
        raise UserError(f"{folder} holds a training with other settings; delete it or use another folder")
    model.load_state_dict(state["model"])
    optimizer.load_state_dict(state["optimizer"])
    return Progress(state["step"], state["stale"], state["best"])
