"""The methods: networks that see tensors and programs, never a robot."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from evaps.dsl import UserError
from evaps.models.base import Repairer, Synthesizer
from evaps.models.checkpoint import CheckpointError, fitting, load_weights, read_config
from evaps.models.encoder import Encoder, EncoderConfig

METHODS = {"lgrl": "evaps.models.lgrl:LGRL", "evaps": "evaps.models.evaps:Evaps"}
"""Where every method's class is, by name; a module is imported when its method is used."""

SHIPPED = Path(__file__).parents[1] / "checkpoints"


@dataclass(frozen=True)
class Model:
    """What synthesis needs: an encoder, a synthesizer, and perhaps a repairer, trained on its features."""

    encoder: Encoder
    synthesizer: Synthesizer
    repairer: Repairer | None


def new_method(name: str, **config: Any) -> Synthesizer | Repairer:
    """A method with fresh weights; ``config`` are fields of its configuration that differ from the defaults.

    Raises:
        UserError: there is no such method.
    """
    if name not in METHODS:
        raise UserError(f"there is no method {name!r}; known are {', '.join(METHODS)}")
    module, _, attribute = METHODS[name].partition(":")
    method = getattr(import_module(module), attribute)
    return method(method.Config(**config))


def load_encoder(folder: Path) -> Encoder:
    """An observation encoder from its checkpoint.

    Raises:
        CheckpointError: there is none, or it is of another version.
    """
    config = read_config(folder, "encoder")["config"]
    with fitting(folder):
        encoder = Encoder(EncoderConfig(**{**config, "channels": tuple(config["channels"])}))
    return load_weights(folder, encoder)


def load_method(folder: Path, name: str) -> Synthesizer | Repairer:
    """A method from its checkpoint.

    Raises:
        CheckpointError: there is none, or it is of another method or version.
    """
    config = read_config(folder, name)["config"]
    with fitting(folder):
        method = new_method(name, **config)
    return load_weights(folder, method)


def model_folder(name: str | Path) -> Path:
    """The folder of a shipped set of checkpoints, or the folder that was named.

    Raises:
        CheckpointError: there is no such folder.
    """
    shipped = {path.name: path for path in sorted(SHIPPED.glob("*/"))}
    folder = shipped.get(str(name), Path(name))
    if not folder.is_dir():
        raise CheckpointError(
            f"there is no checkpoint folder {str(name)!r}; shipped are: {', '.join(shipped) or 'none'}"
        )
    return folder


def load_model(
    name: str | Path = "small", synthesizer: str = "lgrl", repairer: str | None = "evaps"
) -> Model:
    """A trained model: one of the shipped sets by its name, or a folder of checkpoints.

    Args:
        name: ``"small"``, or a folder that holds ``encoder``, and a folder for each method.
        synthesizer: who proposes.
        repairer: who repairs; None for proposals alone.

    Raises:
        CheckpointError: there is no such set, or it does not fit this version.
    """
    folder = model_folder(name)
    proposes = load_method(folder / synthesizer, synthesizer)
    repairs = load_method(folder / repairer, repairer) if repairer else None
    assert isinstance(proposes, Synthesizer)
    assert repairs is None or isinstance(repairs, Repairer)
    return Model(load_encoder(folder / "encoder"), proposes, repairs)
