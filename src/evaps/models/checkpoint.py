"""Checkpoints: one folder with the weights (safetensors) and all that is needed to use them again."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

from safetensors.torch import load_file, save
from torch import Tensor, nn

from evaps.dsl import VOCAB, UserError

FORMAT = 1
Model = TypeVar("Model", bound=nn.Module)


class CheckpointError(UserError):
    """A checkpoint that cannot be used here; the message says why, in one line."""


def save_checkpoint(folder: Path, model: Any, name: str, facts: dict[str, Any]) -> None:
    """Write ``model.safetensors`` (half precision), then ``config.json``, which thus means: done.

    Args:
        folder: where to.
        model: has its configuration as ``config``.
        name: the method's name.
        facts: how it was made: seed, scale, data set, commit, metrics.
    """
    folder.mkdir(parents=True, exist_ok=True)
    weights = {key: _halved(value.detach().cpu()) for key, value in model.state_dict().items()}
    part = folder / ".model.safetensors.part"
    part.write_bytes(save(weights))
    part.replace(folder / "model.safetensors")
    config = {
        "format": FORMAT,
        "method": name,
        "config": asdict(model.config),
        "vocabulary": list(VOCAB.tokens),
    }
    (folder / "config.json").write_text(json.dumps({**config, "facts": facts}, indent=1) + "\n")


def _halved(value: Tensor) -> Tensor:
    return (value.half() if value.is_floating_point() else value).contiguous()


def read_config(folder: Path, name: str) -> dict[str, Any]:
    """The content of ``config.json``.

    Raises:
        CheckpointError: it is missing, of another method, of another version or for another language.
    """
    try:
        config = json.loads((folder / "config.json").read_text())
    except (OSError, json.JSONDecodeError) as error:
        raise CheckpointError(f"{folder} holds no checkpoint: {error}") from None
    for key, wanted in (("format", FORMAT), ("method", name), ("vocabulary", list(VOCAB.tokens))):
        if config.get(key) != wanted:
            found = "of another language" if key == "vocabulary" else f"{config.get(key)!r}, not {wanted!r}"
            raise CheckpointError(f"{folder} cannot be used here: its {key} is {found}")
    return config


def load_weights(folder: Path, model: Model) -> Model:
    """Fill a model with a checkpoint's weights, strictly, and set it to evaluation.

    Raises:
        CheckpointError: the weights do not fit the model.
    """
    try:
        model.load_state_dict(load_file(folder / "model.safetensors"))  # copied into float32 parameters
    except (OSError, RuntimeError) as error:
        raise CheckpointError(
            f"{folder}: the weights do not fit: {' '.join(str(error).split())[:200]}"
        ) from None
    return model.eval()
