"""Checkpoints: what is saved is loaded, and what does not fit is refused with a reason."""

import json
from pathlib import Path

import pytest
import torch

from evaps.models import CheckpointError, UserError, load_method, load_model, new_method
from evaps.models.checkpoint import hash_of, save_checkpoint
from evaps.models.encoder import Encoder, EncoderConfig


@pytest.mark.parametrize(("name", "config"), [("lgrl", {"hidden": 32}), ("evaps", {"graph": False})])
def test_round_trip(tmp_path: Path, name: str, config: dict[str, object]) -> None:
    model = new_method(name, **config)
    save_checkpoint(tmp_path, model, name, {"scale": "smoke"})
    loaded = load_method(tmp_path, name)
    assert loaded.config == model.config
    assert not loaded.training
    for a, b in zip(model.parameters(), loaded.parameters(), strict=True):
        assert torch.equal(a.half().float(), b)


@pytest.mark.parametrize(
    ("key", "value", "word"),
    [("vocabulary", ["<pad>"], "vocabulary"), ("method", "sed", "method"), ("format", 0, "format")],
)
def test_what_does_not_fit_is_refused(tmp_path: Path, key: str, value: object, word: str) -> None:
    save_checkpoint(tmp_path, new_method("lgrl"), "lgrl", {})
    config = json.loads((tmp_path / "config.json").read_text())
    (tmp_path / "config.json").write_text(json.dumps({**config, key: value}))
    with pytest.raises(CheckpointError, match=word):
        load_method(tmp_path, "lgrl")


def test_weights_of_another_size_are_refused(tmp_path: Path) -> None:
    save_checkpoint(tmp_path, new_method("lgrl", hidden=32), "lgrl", {})
    config = json.loads((tmp_path / "config.json").read_text())
    config["config"]["hidden"] = 64
    (tmp_path / "config.json").write_text(json.dumps(config))
    with pytest.raises(CheckpointError, match="does not fit") as error:
        load_method(tmp_path, "lgrl")
    assert "\n" not in str(error.value)


def test_unknown_names_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match="no checkpoint folder"):
        load_model(tmp_path / "missing")
    with pytest.raises(UserError, match="no method 'best'"):
        new_method("best")


def test_a_method_without_a_checkpoint_can_be_trained(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match="no checkpoint of sed; train it with: evaps train sed"):
        load_method(tmp_path, "sed")


def test_what_was_trained_with_another_encoder_is_refused(tmp_path: Path) -> None:
    save_checkpoint(tmp_path / "encoder", Encoder(EncoderConfig()), "encoder", {})
    for name in ("lgrl", "evaps"):
        facts = {"made_from": {"encoder": hash_of(tmp_path / "encoder")}}
        save_checkpoint(tmp_path / name, new_method(name), name, facts)
    assert load_model(tmp_path, "evaps").repairer is not None
    save_checkpoint(tmp_path / "evaps", new_method("evaps"), "evaps", {})  # who does not say is not believed
    with pytest.raises(CheckpointError, match="evaps was trained with another encoder than"):
        load_model(tmp_path, "evaps")
    save_checkpoint(tmp_path / "encoder", Encoder(EncoderConfig()), "encoder", {})
    with pytest.raises(CheckpointError, match="lgrl was trained with another encoder than"):
        load_model(tmp_path, "evaps")
