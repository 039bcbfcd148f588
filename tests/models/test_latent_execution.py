"""Latent Execution: when the executor runs, and that what it imagines comes to agree with what happens."""

import numpy as np
import pytest
import torch
from torch.nn import functional as F

from evaps.dsl import VOCAB, Program
from evaps.dsl.sampler import sample_program
from evaps.models.latent_execution import LatentExecution, LatentExecutionConfig
from evaps.train.lessons import Lessons

PROGRAM = Program.parse("DEF run m( MOVE_LEFT IF c( not c( ISTHERE Demon c) c) i( ATTACK i) TURN_LEFT m)")


def test_the_executor_runs_where_a_statement_ends_and_only_there() -> None:
    torch.manual_seed(0)
    net = LatentExecution().eval()
    state, _ = net.start(torch.randn(1, 5, 2, 256)), None
    for token in PROGRAM.tokens:
        before = state.latent
        _, state = net.step(state, torch.tensor([VOCAB.ids[token]]), None)
        changed = not torch.equal(before, state.latent)
        assert changed == (token in ("MOVE_LEFT", "ATTACK", "i)", "TURN_LEFT")), token


def test_the_last_state_comes_to_agree_with_the_output() -> None:
    torch.manual_seed(0)
    rng = np.random.default_rng(0)
    lessons = Lessons.of([VOCAB.encode(sample_program(rng).tokens) for _ in range(16)])
    tokens, masks = lessons.batch(range(16))
    features = F.normalize(torch.randn(16, 5, 2, 32), dim=-1) * 4
    net = LatentExecution(LatentExecutionConfig(feature=32, pair=64, hidden=64, dropout=0.0, agreement=1.0))

    def disagreement() -> float:
        with torch.no_grad():
            likelihood = -net.log_probabilities(features, tokens, masks).sum() / (tokens > 0).sum()
            return float(net.loss(features, tokens, masks) - likelihood)

    before = disagreement()
    assert before > 1, "about log(5) where nothing is known"
    optimizer = torch.optim.Adam(net.parameters(), lr=3e-3)
    for _ in range(30):
        optimizer.zero_grad()
        net.loss(features, tokens, masks).backward()
        optimizer.step()
    assert disagreement() < 0.3 * before


def test_outputs_get_no_gradient_from_the_agreement() -> None:
    torch.manual_seed(0)
    net = LatentExecution(LatentExecutionConfig(feature=16, pair=32, hidden=32)).eval()
    features = torch.randn(2, 5, 2, 16, requires_grad=True)
    last = torch.randn(2, 5, 16)
    with pytest.raises(RuntimeError, match="does not require grad"):
        net._disagreement(last, features, torch.ones(2, 4, dtype=torch.long)).backward()
