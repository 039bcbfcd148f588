"""The training loop: interrupted anywhere, it goes on with the same result."""

import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from evaps.dsl import UserError
from evaps.train.batches import batch_at
from evaps.train.loop import FitConfig, Share, fit, rate_at

CONFIG = FitConfig(steps=20, rate=1e-2, seed=3, warmup=4, log_every=5, save_every=0.0, validate_every=10)


def new_model() -> nn.Module:
    torch.manual_seed(0)
    return nn.Sequential(nn.Linear(4, 8), nn.Dropout(0.5), nn.Linear(8, 1))


def train(
    model: nn.Module, folder: Path, stop_at: int | None = None, config: FitConfig = CONFIG
) -> dict[str, float]:
    def loss_at(step: int, share: Share) -> tuple[Tensor, dict[str, float]]:
        if step == stop_at:
            raise KeyboardInterrupt
        x = torch.from_numpy(np.random.default_rng(step).normal(size=(16, 4)).astype(np.float32))
        x = share.of(x)
        return F.mse_loss(model(x), x.sum(1, keepdim=True)), {}

    def validate() -> dict[str, float]:
        x = torch.eye(4)
        return {"score": -F.mse_loss(model(x), x.sum(1, keepdim=True)).item()}

    return fit(model, loss_at, config, folder, validate, "score")


@pytest.mark.parametrize("stop_at", [1, 7, 19])
def test_an_interrupted_run_ends_where_a_whole_one_does(tmp_path: Path, stop_at: int) -> None:
    whole, broken = new_model(), new_model()
    expected = train(whole, tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        train(broken, tmp_path / "broken", stop_at)
    resumed = new_model()
    metrics = train(resumed, tmp_path / "broken")
    assert metrics == expected
    assert metrics["best_step"] == 19  # weights from behind every interruption
    logs = [(tmp_path / run / "metrics.jsonl").read_text() for run in ("whole", "broken")]
    assert logs[0] == logs[1]  # what was done again has one row
    for a, b in zip(whole.parameters(), resumed.parameters(), strict=True):
        assert torch.equal(a, b)


def test_what_was_logged_and_not_saved_is_logged_once(tmp_path: Path) -> None:
    seldom = replace(CONFIG, save_every=math.inf)
    with pytest.raises(KeyboardInterrupt):
        train(new_model(), tmp_path, stop_at=18, config=seldom)
    with (tmp_path / "metrics.jsonl").open("a") as file:
        file.write('{"step": 17, "lo')  # the power fails
    train(new_model(), tmp_path, config=seldom)
    rows = [json.loads(line) for line in (tmp_path / "metrics.jsonl").read_text().splitlines()]
    assert [row["step"] for row in rows] == [0, 5, 9, 10, 15, 19]


def test_metrics_are_logged_as_json_lines(tmp_path: Path) -> None:
    train(new_model(), tmp_path)
    rows = [json.loads(line) for line in (tmp_path / "metrics.jsonl").read_text().splitlines()]
    assert [row["step"] for row in rows] == [0, 5, 9, 10, 15, 19]
    assert "validation_score" in rows[-1]
    assert rows[-1]["validation_score"] > rows[2]["validation_score"]


def test_other_settings_do_not_go_on_with_it(tmp_path: Path) -> None:
    train(new_model(), tmp_path)
    with pytest.raises(UserError, match="other settings"):
        fit(new_model(), lambda step, share: 1 / 0, replace(CONFIG, seed=4), tmp_path, dict, "score")


def test_what_has_diverged_says_so(tmp_path: Path) -> None:
    broken = new_model()
    with torch.no_grad():
        next(broken.parameters()).fill_(math.nan)
    with pytest.raises(UserError, match="has diverged: its score is no number; delete the folder"):
        train(broken, tmp_path)


def test_the_rate_rises_and_falls() -> None:
    rates = [rate_at(step, CONFIG) for step in range(CONFIG.steps)]
    assert max(rates) <= CONFIG.rate
    assert rates.index(max(rates)) in (3, 4)
    assert rates[-1] < 0.05 * CONFIG.rate


def test_an_epoch_has_every_row_once_and_like_lengths_together() -> None:
    lengths = np.random.default_rng(0).integers(5, 33, 640).tolist()
    at = batch_at(lengths, 32, seed=1)
    epochs = [np.concatenate([at(step) for step in range(e * 20, e * 20 + 20)]) for e in range(2)]
    for epoch in epochs:
        assert sorted(epoch) == list(range(640))
    assert not np.array_equal(*epochs)
    spread = np.mean([np.ptp(np.array(lengths)[at(step)]) for step in range(20)])
    assert spread < 6
    assert np.array_equal(at(7), batch_at(lengths, 32, seed=1)(7))


def test_the_best_weights_are_kept(tmp_path: Path) -> None:
    model, scores, seen = new_model(), iter([0.2, 0.9, 0.1, 0.3]), []

    def validate() -> dict[str, float]:
        seen.append([p.clone() for p in model.parameters()])
        return {"score": next(scores)}

    def loss_at(step: int, share: Share) -> tuple[Tensor, dict[str, float]]:
        return model(torch.ones(2, 4)).square().mean(), {}

    metrics = fit(model, loss_at, replace(CONFIG, validate_every=5), tmp_path, validate, "score")
    assert metrics == {"best_step": 9, "validation_score": 0.9}
    assert all(torch.equal(a, b) for a, b in zip(model.parameters(), seen[1], strict=True))


@pytest.mark.parametrize(("later", "best"), [([0.3, 0.4], -1), ([0.3, 0.6], 19)])
def test_weights_to_start_from_stay_if_nothing_is_better(
    tmp_path: Path, later: list[float], best: int
) -> None:
    model, scores, seen = new_model(), iter([0.5, *later]), []

    def validate() -> dict[str, float]:
        seen.append([p.clone() for p in model.parameters()])
        return {"score": next(scores)}

    def loss_at(step: int, share: Share) -> tuple[Tensor, dict[str, float]]:
        return model(torch.ones(2, 4)).square().mean(), {}

    config = replace(CONFIG, validate_every=10)
    for _ in range(2):  # once more validates nothing
        metrics = fit(model, loss_at, config, tmp_path, validate, "score", keep_start=True)
        assert metrics == {"best_step": best, "validation_score": max(0.5, *later)}
        kept = seen[0 if best == -1 else 2]
        assert all(torch.equal(a, b) for a, b in zip(model.parameters(), kept, strict=True))
    logged = [json.loads(row) for row in (tmp_path / "metrics.jsonl").read_text().splitlines()]
    assert logged[0] == {"step": -1, "validation_score": 0.5}
    assert [row["step"] for row in logged].count(-1) == 1


def test_it_stops_when_nothing_gets_better(tmp_path: Path) -> None:
    config = replace(CONFIG, steps=100, validate_every=2, patience=3)
    scores = iter([0.1, 0.5, 0.4, 0.5, 0.3, 9.0])
    steps = []

    def loss_at(step: int, share: Share) -> tuple[Tensor, dict[str, float]]:
        steps.append(step)
        return model(torch.ones(2, 4)).square().mean(), {}

    for _ in range(2):  # once more does nothing
        model = new_model()
        metrics = fit(model, loss_at, config, tmp_path, lambda: {"score": next(scores)}, "score")
        assert metrics == {"best_step": 3, "validation_score": 0.5}
        assert steps == list(range(10))


def test_metrics_are_written_for_tensorboard_on_request(tmp_path: Path) -> None:
    pytest.importorskip("tensorboard")
    model = new_model()

    def loss_at(step: int, share: Share) -> tuple[Tensor, dict[str, float]]:
        return model(torch.ones(2, 4)).square().mean(), {}

    fit(model, loss_at, CONFIG, tmp_path, lambda: {"score": 1.0}, "score", tensorboard=True)
    assert list(tmp_path.rglob("events.out.tfevents.*"))


SHARED = """
import sys
from pathlib import Path

import torch
from torch import nn
from torch.nn import functional as F

from evaps.train.loop import FitConfig, fit

torch.manual_seed(0)
model = nn.Linear(4, 1)

def loss_at(step, share):
    x = share.of(torch.randn(16, 4, generator=torch.Generator().manual_seed(step)))
    return F.mse_loss(model(x), x.sum(1, keepdim=True)), {}

config = FitConfig(steps=10, rate=1e-2, warmup=2, validate_every=5)
fit(model, loss_at, config, Path(sys.argv[1]), lambda: {"score": model.weight.sum().item()}, "score")
"""


@pytest.mark.slow
def test_two_processes_learn_what_one_does(tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(SHARED)
    launch = [sys.executable, "-m", "accelerate.commands.launch", "--cpu", "--num_processes", "2"]
    for command, folder in (([sys.executable], "one"), ([*launch, "--main_process_port", "0"], "two")):
        subprocess.run([*command, "script.py", folder], cwd=tmp_path, check=True, timeout=120)
    one, two = (torch.load(tmp_path / folder / "best.pt") for folder in ("one", "two"))
    torch.testing.assert_close(one, two)
