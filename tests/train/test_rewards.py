"""Rewards on the beam teach what the likelihood has not: programs that do the right thing."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from torch.nn import functional as F

from evaps.dsl import VOCAB, UserError
from evaps.models.beam import beam_search
from evaps.models.lgrl import LGRL, LGRLConfig
from evaps.robots.workers import Workers
from evaps.tasks.build import generate
from evaps.tasks.dataset import Dataset
from evaps.train import rewards
from evaps.train.judge import Judge
from evaps.train.lessons import Lessons
from evaps.train.rewards import reward_loss
from evaps.train.scale import SCALES

TASKS = 32
MOST_STEPS = 80  # a third is enough as a rule

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    folder = tmp_path_factory.mktemp("rewards") / "data"
    generate(folder, TASKS, 7, workers=Workers(0), frames=False)
    return Dataset(folder)


@pytest.mark.parametrize(("scenes", "reward"), [(6, 1.0), (5, -1.0), (0, -1.0)])
def test_a_program_is_right_if_it_is_in_all_six_scenes(
    scenes: int, reward: float, dataset: Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    torch.manual_seed(0)
    model = LGRL(LGRLConfig(feature=32, pair=64, embedding=64, hidden=128))
    judge = Judge(dataset)
    monkeypatch.setattr(judge, "passed", lambda _, programs: np.full(len(programs), scenes))
    run: Any = SimpleNamespace(
        scale=replace(SCALES["smoke"], rl_beam=4, rl_draws=2),
        task_features=lambda positions, _: torch.randn(len(positions), 5, 2, 32),
        judge=judge,
    )
    loss, metrics = reward_loss(run, model, [0, 1])
    assert metrics["reward"] == pytest.approx(reward)
    assert loss.item() == pytest.approx(-reward, abs=1e-5)


def test_a_task_without_a_proposal_is_not_solved(dataset: Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    torch.manual_seed(0)
    model = LGRL(LGRLConfig(feature=32, pair=64, embedding=64, hidden=128))
    judge = Judge(dataset)
    monkeypatch.setattr(judge, "passed", lambda _, programs: np.full(len(programs), 6))
    run: Any = SimpleNamespace(
        scale=replace(SCALES["smoke"], rl_beam=4, rl_draws=2),
        task_features=lambda positions, _: torch.randn(len(positions), 5, 2, 32),
        judge=judge,
        out=Path("runs"),
    )
    monkeypatch.setattr(rewards, "beam_search", lambda *given: [[], *beam_search(*given)[1:]])
    loss, metrics = reward_loss(run, model, [0, 1])
    assert loss.item() == pytest.approx(0.0, abs=1e-5)
    assert (metrics["reward"], metrics["solvable"]) == (pytest.approx(0.0, abs=1e-5), 0.5)
    monkeypatch.setattr(rewards, "beam_search", lambda *given: [[], []])
    with pytest.raises(UserError, match="has diverged"):
        reward_loss(run, model, [0, 1])


def test_rewards_teach_32_tasks(dataset: Dataset) -> None:
    torch.manual_seed(0)
    model = LGRL(LGRLConfig(feature=32, pair=64, embedding=64, hidden=128, dropout=0.0))
    features = F.normalize(torch.randn(TASKS, 5, 2, 32), dim=-1) * 4
    judge = Judge(dataset)
    run: Any = SimpleNamespace(
        scale=replace(SCALES["smoke"], rl_beam=8, rl_draws=1),
        task_features=lambda positions, _: features[positions],
        judge=judge,
    )
    lessons = Lessons.of([VOCAB.encode(program.split()) for program in dataset.rows.column("program")])
    optimizer = torch.optim.Adam(model.parameters(), lr=2e-3)

    def share_right() -> float:
        beams = beam_search(model.eval(), features, 4)
        return judge.share_right(range(TASKS), [beam[0].program for beam in beams])

    def step(loss: torch.Tensor) -> None:
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimizer.step()

    positions: Sequence[int] = range(TASKS)
    for _ in range(60):
        step(model.loss(features, *lessons.batch(positions)))
    for number in range(200):
        if number % 4 == 0 and share_right() >= 0.75:  # looking takes longer than learning
            break
        step(model.loss(features, *lessons.batch(positions)))
    before = share_right()
    assert before < 0.95, "there is something left to learn"
    for group in optimizer.param_groups:
        group["lr"] = 1e-3
    rewards = []
    while (len(rewards) % 2 or share_right() < 0.95) and len(rewards) < MOST_STEPS:
        loss, metrics = reward_loss(run, model, list(positions))
        step(loss)
        rewards.append(metrics["reward"])
    assert share_right() >= 0.95
    assert rewards[-1] > rewards[0]
