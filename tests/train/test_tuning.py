"""The encoder, trained on with what programs need."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch

from evaps.dsl import UserError
from evaps.models import SHIPPED, load_encoder, load_method
from evaps.models.encoder import EncoderConfig, TransitionModel
from evaps.robots.workers import Workers
from evaps.tasks.dataset import Dataset
from evaps.train import train, tuning
from evaps.train.batches import one_ahead
from evaps.train.loop import FitConfig, Share
from evaps.train.run import Run
from evaps.train.tuning import TaskFrames, TunedEncoder

MODEL = SHIPPED / "small"
ROWS = [0, 3]
PAIRS = np.array([[5, 0, 1, 2, 3], [4, 3, 2, 1, 0]])

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def run(dataset: Dataset, tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("runs")
    (folder / "encoder").symlink_to(MODEL / "encoder")
    return Run(dataset, folder, "smoke", 0, Workers(0))


@pytest.fixture(scope="module")
def tasks(run: Run) -> TaskFrames:
    return TaskFrames(run, run.dataset.split("train")[:4])


@pytest.fixture
def tuned() -> TunedEncoder:
    transitions = TransitionModel(EncoderConfig())
    transitions.encoder.load_state_dict(load_encoder(MODEL / "encoder").state_dict())
    return TunedEncoder(transitions, load_method(MODEL / "lgrl", "lgrl"))


def loss_of(tuned: TunedEncoder, tasks: TaskFrames) -> torch.Tensor:
    return tuned.likelihood_loss(tasks.frames(ROWS, PAIRS), *tasks.lessons.batch(ROWS))


def test_the_synthesizer_sees_what_it_would_see_of_a_frozen_encoder(
    run: Run, tasks: TaskFrames, tuned: TunedEncoder
) -> None:
    positions = [run.dataset.split("train")[row] for row in ROWS]
    tuned.eval()
    with torch.inference_mode():
        frozen = tuned.synthesizer.loss(run.task_features(positions, PAIRS), *tasks.lessons.batch(ROWS))
        assert loss_of(tuned, tasks).item() == pytest.approx(
            frozen.item(), rel=1e-3
        )  # kept in half precision


def test_the_encoder_learns_and_the_statistics_of_its_layers_stay(
    tasks: TaskFrames, tuned: TunedEncoder
) -> None:
    tuned.train()
    encoder = tuned.transitions.encoder
    before = {name: value.clone() for name, value in encoder.named_buffers()}
    loss_of(tuned, tasks).backward()
    assert tuned.synthesizer.training
    assert all(torch.equal(value, before[name]) for name, value in encoder.named_buffers())
    assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in encoder.parameters())


@pytest.mark.parametrize("steps", [range(5), [3, 4, 5], [0, 2, 1]])
def test_batches_made_ahead_are_the_same(steps: list[int]) -> None:
    batch = one_ahead(lambda step, share: (step, share.index))
    assert [batch(step, Share(1, 2)) for step in steps] == [(step, 1) for step in steps]


def test_an_interrupted_tuning_ends_where_a_whole_one_does(
    dataset: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tuning, "FitConfig", partial(FitConfig, save_every=0.0))

    def tuned_weights(name: str, stop_at: int | None = None) -> dict[str, torch.Tensor]:
        run = Run(dataset, tmp_path / name, "smoke", 0, Workers(0))
        torch.manual_seed(0)
        model = TransitionModel(EncoderConfig())
        model.encoder.load_state_dict(load_encoder(MODEL / "encoder").state_dict())

        def walks_loss(step: int, share: Share) -> tuple[torch.Tensor, dict[str, float]]:
            if step - run.scale.encoder_steps == stop_at:
                raise KeyboardInterrupt
            return model.encoder.linear.weight.square().mean(), {}

        tuning.tune_encoder(run, model, walks_loss, dict, {})
        return model.encoder.state_dict()

    whole = tuned_weights("whole")
    with pytest.raises(KeyboardInterrupt):
        tuned_weights("stopped", stop_at=1)
    torch.testing.assert_close(tuned_weights("stopped", stop_at=0), whole, rtol=0, atol=0)


def test_only_the_encoder_is_tuned(dataset: Dataset, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="tuning is for the encoder, not for lgrl"):
        train("lgrl", dataset.folder, tmp_path, "smoke", tuning=3)
