"""The list of methods: the paper's ablations differ in what they see, and in nothing else."""

import pytest

from evaps.dsl import UserError
from evaps.models import METHODS, is_repairer, load_method, load_model, needed_for, new_method
from evaps.models.checkpoint import CheckpointError, hash_of, save_checkpoint
from evaps.models.encoder import Encoder, EncoderConfig
from evaps.models.evaps import Evaps

ABLATIONS = {
    "naive": (False, False),
    "evaps-o": (True, False),
    "evaps-s": (False, True),
    "evaps": (True, True),
}


@pytest.mark.parametrize(("name", "flags"), ABLATIONS.items())
def test_an_ablation_leaves_out_what_its_name_says(name, flags) -> None:
    method = new_method(name)
    assert isinstance(method, Evaps)
    assert (method.config.observations, method.config.graph) == flags
    assert method.config.goal
    assert (method.segment is not None, len(method.graph) > 0) == flags
    assert method.name == name
    assert is_repairer(name)


def test_a_checkpoint_of_one_method_is_not_taken_for_another(tmp_path) -> None:
    for name in ("naive", "sed"):
        save_checkpoint(tmp_path / name, new_method(name), name, {})
        again = load_method(tmp_path / name, name)
        assert (again.name, again.config) == (name, new_method(name).config)
        with pytest.raises(CheckpointError, match="its method is"):
            load_method(tmp_path / name, "evaps")


def test_a_method_that_is_not_there_is_told() -> None:
    with pytest.raises(UserError, match="no method 'nobody'; known are lgrl, lgrl-rl"):
        new_method("nobody")
    assert list(METHODS)[-1] == "evaps"


def test_a_repairer_mends_what_any_synthesizer_proposes(tmp_path) -> None:
    save_checkpoint(tmp_path / "encoder", Encoder(EncoderConfig()), "encoder", {})
    facts = {"made_from": {"encoder": hash_of(tmp_path / "encoder")}}
    for name in ("lgrl", "transformer", "naive"):
        save_checkpoint(tmp_path / name, new_method(name), name, facts)
    assert needed_for("transformer+naive") == ("encoder", "transformer", "naive")
    for method, proposer in (("naive", "lgrl"), ("transformer+naive", "transformer")):
        model = load_model(tmp_path, method)
        assert model.repairer is not None
        assert (model.synthesizer.name, model.repairer.name) == (proposer, "naive")


@pytest.mark.parametrize("method", ["naive+lgrl", "lgrl+transformer", "naive+sed", "lgrl+verified", "lgrl+"])
def test_who_cannot_propose_or_mend_is_refused(method: str) -> None:
    with pytest.raises(UserError, match=r"has to be a synthesizer, '\+' and a repairer|there is no method"):
        needed_for(method)
