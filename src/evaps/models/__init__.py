"""The methods: networks that see tensors and programs, never a robot."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import nn

from evaps.domain import CHOSEN
from evaps.dsl import UserError
from evaps.models.base import Repairer, Synthesizer
from evaps.models.checkpoint import CheckpointError, fitting, hash_of, load_weights, read_config
from evaps.models.encoder import Encoder, EncoderConfig
from evaps.models.hub import PREFIX, fetch
from evaps.models.inverse import InverseConfig, InverseModel

Network = TypeVar("Network", bound=nn.Module)


@dataclass(frozen=True)
class Method:
    """A method's class, and how it differs from the class's defaults.

    Attributes:
        where: module and name of the class; the module is imported when the method is used.
        config: fields of its configuration.
        start: the method whose weights it starts from, to be improved by rewards.
    """

    where: str
    config: Mapping[str, Any] = field(default_factory=dict)
    start: str | None = None


METHODS = {
    "lgrl": Method("evaps.models.lgrl:LGRL"),
    "lgrl-rl": Method("evaps.models.lgrl:LGRL", start="lgrl"),
    "transformer": Method("evaps.models.transformer:Transformer"),
    "inferred-trace": Method("evaps.models.inferred_trace:InferredTrace"),
    "latent-execution": Method("evaps.models.latent_execution:LatentExecution"),
    "sed": Method("evaps.models.sed:SED"),
    "evaps-parallel": Method("evaps.models.evaps:Evaps", {"edits": "parallel"}),
    "evaps-substitution": Method("evaps.models.evaps:Evaps", {"edits": "substitution"}),
    "evaps-no-goal": Method("evaps.models.evaps:Evaps", {"goal": False}),
    "naive": Method("evaps.models.evaps:Evaps", {"observations": False, "graph": False}),
    "evaps-o": Method("evaps.models.evaps:Evaps", {"graph": False}),
    "evaps-s": Method("evaps.models.evaps:Evaps", {"observations": False}),
    "evaps": Method("evaps.models.evaps:Evaps"),
}
"""Every method by its name; `naive`, `evaps-o` and `evaps-s` are the paper's ablations of EVAPS.

``evaps-parallel`` and ``evaps-substitution`` are other readings of how EVAPS edits, ``evaps-no-goal`` of what
it is told: what was seen, and not what should have been."""

PROPOSER = "lgrl"
"""The synthesizer whose candidates repairers learn from and mend."""

VERIFIED = "verified"
SEARCHES: dict[str, tuple[str, ...]] = {
    VERIFIED: ("encoder", PROPOSER, "inverse"),
    "verified-no-guide": ("encoder", PROPOSER, "inverse"),
    "verified-no-sharing": ("encoder", PROPOSER, "inverse"),
    "verified-no-beam": ("encoder", PROPOSER, "inverse"),
    "verified-with-repairs": ("encoder", PROPOSER, "inverse", "evaps"),
    "sed-search": ("encoder", PROPOSER, "sed"),
    "enumeration": ("encoder", PROPOSER),
    "blind": ("encoder", PROPOSER),
    "prior": ("encoder", PROPOSER),
}
"""Searches, which are no networks of their own, and the checkpoints that they use: see `evaps.synthesis`.

``verified``, the same without one of its parts, the same with EVAPS's repairs, SED's own search, and three
that learn nothing: ``enumeration`` by cost, ``blind``, which draws programs until one passes, and ``prior``,
which draws as many as are wanted.
"""

for _entry in entry_points(group="evaps.methods"):
    # methods of other packages, which name them as entry points: name = "module:Class"
    if _entry.name in METHODS or _entry.name in SEARCHES:
        warnings.warn(f"{_entry.value} is not used: there is a method {_entry.name!r} already", stacklevel=1)
    else:
        METHODS[_entry.name] = Method(_entry.value)

SHIPPED = Path(__file__).parents[1] / "checkpoints"


@dataclass(frozen=True)
class Model:
    """What synthesis needs: an encoder, and what was trained on its features.

    Attributes:
        encoder: embeds observations.
        synthesizer: proposes programs.
        repairer: mends them; None if nobody does.
        inverse: guides verified synthesis.
        search: a name in SEARCHES; None for the paper's own loop.
    """

    encoder: Encoder
    synthesizer: Synthesizer
    repairer: Repairer | None
    inverse: InverseModel | None = None
    search: str | None = None


def method_class(name: str) -> type[Synthesizer] | type[Repairer]:
    """The class of a method; its base says which of the two roles it has.

    Raises:
        UserError: there is no such method, or it cannot be loaded.
    """
    if name not in METHODS:
        raise UserError(f"there is no method {name!r}; known are {', '.join((*METHODS, *SEARCHES))}")
    where = METHODS[name].where
    module, _, attribute = where.partition(":")
    try:
        found = getattr(import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise UserError(f"the method {name!r}, {where}, cannot be loaded: {error}") from error
    if not (isinstance(found, type) and issubclass(found, Synthesizer | Repairer)):
        raise UserError(f"the method {name!r}, {where}, is neither a Synthesizer nor a Repairer")
    return found


def is_repairer(name: str) -> bool:
    """Whether a method mends what PROPOSER proposes, rather than proposing itself.

    Raises:
        UserError: there is no such method.
    """
    return issubclass(method_class(name), Repairer)


def proposer_and_repairer(method: str) -> tuple[str, str | None]:
    """Who proposes and who mends; a repairer alone mends PROPOSER's candidates.

    Args:
        method: a synthesizer, a repairer, or ``synthesizer+repairer``.

    Raises:
        UserError: there is no such method, or it does not have the role that its place asks for.
    """
    first, plus, second = method.partition("+")
    if not plus:
        return (PROPOSER, first) if is_repairer(first) else (first, None)
    if is_repairer(first) or not is_repairer(second):
        raise UserError(
            f"{method!r} has to be a synthesizer, '+' and a repairer, as in 'inferred-trace+evaps'"
        )
    return first, second


def needed_for(method: str) -> tuple[str, ...]:
    """The checkpoints that a method's answers depend on; its own comes last.

    Raises:
        UserError: there is no such method.
    """
    if method in SEARCHES:
        return SEARCHES[method]
    proposer, repairer = proposer_and_repairer(method)
    return ("encoder", proposer, repairer) if repairer else ("encoder", proposer)


def new_method(name: str, **config: Any) -> Synthesizer | Repairer:
    """A method with fresh weights; ``config`` are fields of its configuration that differ from the defaults.

    Raises:
        UserError: there is no such method.
    """
    method: Any = method_class(name)
    made: Synthesizer | Repairer = method(method.Config(**{**METHODS[name].config, **config}))
    made.name = name
    return made


def load_encoder(folder: Path) -> Encoder:
    """An observation encoder from its checkpoint.

    Raises:
        CheckpointError: there is none, or it is of another version.
    """
    return _loaded(folder, "encoder", lambda **config: Encoder(EncoderConfig(**config)))


def load_method(folder: Path, name: str) -> Synthesizer | Repairer:
    """A method from its checkpoint.

    Raises:
        CheckpointError: there is none, or it is of another method or version.
    """
    return _loaded(folder, name, lambda **config: new_method(name, **config))


def _loaded(folder: Path, name: str, make: Callable[..., Network]) -> Network:
    """A network of a checkpoint's configuration, with its weights; JSON's lists are tuples in it.

    The random weights that it has at first are drawn aside: who has seeded torch finds it as it was.
    """
    config = read_config(folder, name)["config"]
    with fitting(folder), torch.random.fork_rng(devices=[]):
        made = make(**{k: tuple(v) if isinstance(v, list) else v for k, v in config.items()})
    return load_weights(folder, made)


def model_folder(name: str | Path) -> Path:
    """The folder of a shipped set of checkpoints, of one from a hub, or the folder that was named.

    Raises:
        CheckpointError: there is no such folder, or it cannot be fetched.
    """
    if str(name).startswith(PREFIX):
        return fetch(str(name))
    shipped = {path.name: path for path in sorted(SHIPPED.glob("*/"))}
    folder = shipped.get(str(name), Path(name))
    if not folder.is_dir():
        raise CheckpointError(
            f"there is no checkpoint folder {str(name)!r}; shipped are: {', '.join(shipped) or 'none'}; "
            "evaps train makes one"
        )
    return folder


def methods_in(folder: Path) -> list[str]:
    """The methods whose checkpoints are in a folder; verified synthesis first, if it is one of them."""
    names = (VERIFIED, *METHODS, *(name for name in SEARCHES if name != VERIFIED))
    needed = {name: SEARCHES.get(name, ("encoder", name)) for name in names}  # without importing any
    return [m for m in names if all((folder / part / "config.json").exists() for part in needed[m])]


def load_inverse(folder: Path) -> InverseModel:
    """An inverse model from its checkpoint.

    Raises:
        CheckpointError: there is none, or it is of another version.
    """
    return _loaded(folder, "inverse", lambda **config: InverseModel(InverseConfig(**config)))


def check_encoder(folder: Path, needed: Iterable[str]) -> None:
    """Whether all that is needed was trained on features of the encoder that lies beside it.

    Raises:
        CheckpointError: one was not, or is not there.
    """
    there = hash_of(folder / "encoder")
    for name in needed:
        made_from = read_config(folder / name, name)["facts"].get("made_from", {})
        if name != "encoder" and made_from.get("encoder") != there:
            raise CheckpointError(
                f"{folder / name} was trained with another encoder than {folder / 'encoder'}; train it again"
            )


def load_model(name: str | Path = CHOSEN.model, method: str = VERIFIED) -> Model:
    """A trained model: one of the shipped sets by its name, a folder of checkpoints, or a set from a hub.

    Args:
        name: a shipped set, ``"small"`` or, for Karel, ``"karel"``; or a folder that holds ``encoder``, and a
            folder for each method; or ``"hub:OWNER/NAME"`` for such a folder on the Hugging Face hub.
        method: a name in SEARCHES; or a synthesizer, which proposes alone; or a repairer, which mends what
            PROPOSER proposes; or ``synthesizer+repairer``, where it mends another's candidates.

    Raises:
        UserError: there is no such method.
        CheckpointError: there is no such set, or it does not fit this version.
    """
    folder = model_folder(name)
    check_encoder(folder, needed_for(method))
    return _model_in(folder, method)


def _model_in(folder: Path, method: str) -> Model:
    if method in SEARCHES:
        needed = SEARCHES[method]
        inverse = load_inverse(folder / "inverse") if "inverse" in needed else None
        loop = _model_in(folder, needed[-1] if needed[-1] in METHODS else PROPOSER)
        return replace(loop, inverse=inverse, search=method)
    proposer, mender = proposer_and_repairer(method)
    synthesizer = load_method(folder / proposer, proposer)
    repairer = load_method(folder / mender, mender) if mender else None
    assert isinstance(synthesizer, Synthesizer)
    assert repairer is None or isinstance(repairer, Repairer)
    return Model(load_encoder(folder / "encoder"), synthesizer, repairer)
