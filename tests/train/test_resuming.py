"""What trainings make beside their steps is made in parts: interrupted anywhere, it goes on, to the same."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest

from evaps.dsl import VOCAB, Program
from evaps.models import SHIPPED, load_encoder, new_method
from evaps.models.base import Synthesizer
from evaps.tasks.dataset import Dataset
from evaps.train import features, repairers, synthesizers
from evaps.train.features import dataset_features
from evaps.train.repairers import find_mistakes
from evaps.train.run import Run

T = TypeVar("T")

pytestmark = pytest.mark.slow


def stops_at(call: int, function: Callable[..., T]) -> Callable[..., T]:
    """A function that is interrupted at a call, counted from 1, and works in the others."""
    calls = 0

    def interrupted(*args: Any, **kwargs: Any) -> T:
        nonlocal calls
        calls += 1
        if calls == call:
            raise KeyboardInterrupt
        return function(*args, **kwargs)

    return interrupted


def test_features_go_on(dataset: Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    encoder = load_encoder(SHIPPED / "small" / "encoder")
    whole = dataset_features(dataset, encoder, "whole")
    assert whole.shape == (len(dataset), 6, 2, 256)
    monkeypatch.setattr(features, "PART", 10)
    monkeypatch.setattr(features, "embed", stops_at(2, features.embed))
    with pytest.raises(KeyboardInterrupt):
        dataset_features(dataset, encoder, "parts")
    (parts,) = dataset.folder.glob("features-parts-*.parts")
    assert [path.name for path in parts.iterdir()] == ["part-0000000.npy"]
    assert np.array_equal(dataset_features(dataset, encoder, "parts"), whole)
    assert not parts.exists()


def test_mistakes_go_on(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evaps.synthesis.mistakes.TASKS", 4)
    monkeypatch.setattr(repairers, "_wrong", stops_at(6, repairers._wrong))
    with pytest.raises(KeyboardInterrupt):
        find_mistakes(run, "train")
    (folder,) = run.dataset.folder.glob("mistakes-train-*")
    assert len(list(folder.glob("*.parquet"))) == 1
    resumed = find_mistakes(run, "train")
    for file in folder.iterdir():
        file.unlink()
    whole = find_mistakes(run, "train")
    assert [e.program for e in resumed.executions] == [e.program for e in whole.executions]
    assert resumed.stages == whole.stages
    assert set(whole.stages) == {1, 2}
    assert np.array_equal(resumed.table, whole.table)


def test_own_targets_go_on(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Decoded is every second task's gold program, and the same for the task before, where it is wrong."""
    model = new_method("latent-execution")
    assert isinstance(model, Synthesizer)
    golds = [row["program"] for row in run.dataset.rows]

    def beam(_: object, positions: list[int], __: int) -> Iterator[list[Program]]:
        return ([Program.parse(golds[p | 1])] for p in positions)

    monkeypatch.setattr(run, "beam", beam)
    monkeypatch.setattr(synthesizers, "OWN_TOGETHER", 4)
    monkeypatch.setattr(synthesizers, "_own_programs", stops_at(2, synthesizers._own_programs))
    with pytest.raises(KeyboardInterrupt):
        synthesizers._own_targets(run, model, range(8), tmp_path / "own")
    assert [path.name for path in (tmp_path / "own").iterdir()] == ["own-000000.json"]
    own = synthesizers._own_targets(run, model, range(8), tmp_path / "own")
    assert own == {p: VOCAB.encode(golds[p].split()) for p in (1, 3, 5, 7)}
