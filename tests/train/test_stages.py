"""What a training learns from at each stage, and which weights it keeps."""

from collections import Counter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from evaps.models import new_method
from evaps.models.base import Repairer, Synthesizer
from evaps.models.inferred_trace import InferredTrace
from evaps.synthesis.mistakes import how_often
from evaps.train import inferred_trace, repairers, synthesizers
from evaps.train.loop import Share
from evaps.train.run import Run
from evaps.train.scale import SCALES

pytestmark = pytest.mark.slow


def test_more_mutations_at_once_are_likelier() -> None:
    """1 : 2 : 3, as in Gupta et al., 2020."""
    counts = Counter(how_often(6_000, np.random.default_rng(0)))
    assert {n: round(counts[n] / 1_000) for n in counts} == {1: 1, 2: 2, 3: 3}


def test_a_repairer_learns_from_mutations_first_and_then_from_failures(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    mistakes = repairers.find_mistakes(run, "train")
    learned: dict[int, set[int]] = {}

    def fit(model: object, loss_at: Any, config: Any, *_: object) -> dict[str, float]:
        for step in range(config.steps):
            learned[step] = set()
            loss_at(step, Share())
        return {}

    def mistake_loss(model: object, found: object, rows: Any, table: object) -> torch.Tensor:
        learned[max(learned)] |= {mistakes.stages[row] for row in rows}
        return torch.zeros(())

    monkeypatch.setattr(repairers, "find_mistakes", lambda *_: mistakes)
    monkeypatch.setattr(repairers, "fit", fit)
    monkeypatch.setattr(repairers, "mistake_loss", mistake_loss)
    model = new_method("naive")
    assert isinstance(model, Repairer)
    repairers.train_repairer(run, model)
    first, second = SCALES["smoke"].repairer_steps
    assert [learned[step] for step in range(first + second)] == [{1}] * first + [{2}] * second


@pytest.mark.parametrize(("score", "kept"), [(0.1, 1.0), (0.5, 2.0)])
def test_latent_execution_keeps_the_better_of_its_two_rounds(
    score: float, kept: float, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    rounds = iter([(1.0, 0.3), (2.0, score)])

    def fit_likelihood(_: object, model: Synthesizer, *__: object) -> dict[str, float]:
        weight, reached = next(rounds)
        with torch.no_grad():
            model.get_parameter("output.bias").fill_(weight)
        return {"validation_score": reached}

    monkeypatch.setattr(synthesizers, "fit_likelihood", fit_likelihood)
    monkeypatch.setattr(synthesizers, "_own_targets", lambda *_: {})
    model = new_method("latent-execution")
    assert isinstance(model, Synthesizer)
    synthesizers.train_synthesizer(run, model)
    assert model.get_parameter("output.bias").unique().tolist() == [kept]


def test_inferred_trace_learns_programs_from_where_its_policy_went(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    learned_from = []

    def ways_of(_: object, __: object, positions: list[int], policy: Path) -> SimpleNamespace:
        return SimpleNamespace(positions=positions, policy=policy, reached=np.ones((len(positions), 5)))

    def fit_likelihood(run: Run, _: object, positions: list[int], *__: object) -> dict[str, float]:
        assert run.ways is not None
        ways, row_of = run.ways
        assert [vars(ways)["positions"][row_of[p]] for p in positions] == positions
        learned_from.append(vars(ways)["policy"])
        return {}

    monkeypatch.setattr(inferred_trace, "_fit_policy", lambda *_: {})
    monkeypatch.setattr(inferred_trace, "_ways", ways_of)
    monkeypatch.setattr(inferred_trace, "fit_likelihood", fit_likelihood)
    model = new_method("inferred-trace")
    assert isinstance(model, InferredTrace)
    inferred_trace.train_inferred_trace(run, model)
    assert learned_from == [run.out / "inferred-trace" / "policy" / "best.pt"]
