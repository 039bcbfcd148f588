"""Checkpoints: one folder with the weights (safetensors) and all that is needed to use them again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

from safetensors import SafetensorError
from safetensors.torch import load_file, save
from torch import Tensor, nn

from evaps.domain import CHOSEN, DOOM, VARIABLE
from evaps.dsl import VOCAB, UserError
from evaps.files import write_atomically

FORMAT = 2
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
    weights = {key: _halved(value.detach().cpu()) for key, value in model.state_dict().items()}
    write_atomically(folder / "model.safetensors", save(weights))
    config = {
        "format": FORMAT,
        "method": name,
        "config": asdict(model.config),
        "domain": CHOSEN.name,
        "vocabulary": list(VOCAB.tokens),
    }
    text = json.dumps({**config, "facts": facts}, indent=1) + "\n"
    write_atomically(folder / "config.json", text.encode())


def _halved(value: Tensor) -> Tensor:
    return (value.half() if value.is_floating_point() else value).contiguous()


def read_config(folder: Path, name: str) -> dict[str, Any]:
    """The content of ``config.json``.

    Raises:
        CheckpointError: it is missing, of another method, of another version or for another language.
    """
    try:
        config = json.loads((folder / "config.json").read_text())
    except FileNotFoundError:
        raise CheckpointError(
            f"{folder} holds no checkpoint of {name}; train it with: "
            f"evaps train {name} --data DATA --out {folder.parent}"
        ) from None
    except (OSError, ValueError) as error:
        raise CheckpointError(f"{folder} holds no checkpoint of {name}: {error}") from None
    if not isinstance(config, dict):
        raise CheckpointError(f"{folder} holds no checkpoint of {name}: config.json is no object")
    if (domain := config.get("domain", DOOM.name)) != CHOSEN.name:
        raise CheckpointError(
            f"{folder} is of the domain {domain!r}, and this is {CHOSEN.name!r}; set {VARIABLE}={domain}, "
            "or train one"
        )
    for key, wanted in (("format", FORMAT), ("method", name), ("vocabulary", list(VOCAB.tokens))):
        if config.get(key) != wanted:
            found = "of another language" if key == "vocabulary" else f"{config.get(key)!r}, not {wanted!r}"
            raise CheckpointError(f"{folder} cannot be used here: its {key} is {found}")
    for key in ("config", "facts"):
        if not isinstance(config.get(key), dict):
            raise CheckpointError(f"{folder} cannot be used here: config.json has no {key!r}")
    return config


def hash_of(folder: Path) -> str:
    """Of a checkpoint's weights and configuration, for the names of what is made with them.

    Raises:
        CheckpointError: there is none.
    """
    config = json.dumps(read_config(folder, folder.name)["config"], sort_keys=True)
    with fitting(folder):
        content = (folder / "model.safetensors").read_bytes()
    return hashlib.sha256(config.encode() + content).hexdigest()[:12]


def load_weights(folder: Path, model: Model) -> Model:
    """Fill a model with a checkpoint's weights, strictly, and set it to evaluation.

    Raises:
        CheckpointError: the weights do not fit the model.
    """
    with fitting(folder):
        model.load_state_dict(load_file(folder / "model.safetensors"))  # copied into float32 parameters
    return model.eval()


@contextmanager
def fitting(folder: Path) -> Iterator[None]:
    """Turns what goes wrong with the content of a checkpoint into one line.

    Raises:
        CheckpointError: it is damaged, or does not fit this version.
    """
    try:
        yield
    except (OSError, RuntimeError, TypeError, KeyError, SafetensorError) as error:
        reason = " ".join(str(error).split())[:200]
        raise CheckpointError(f"{folder} does not fit this version, or is damaged: {reason}") from None
