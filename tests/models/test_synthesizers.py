"""Every synthesizer: masks, invariances, and that it can learn."""

import numpy as np
import pytest
import torch
from torch.nn import functional as F

from evaps.dsl import VOCAB
from evaps.dsl.sampler import PERCEPTION_KEYS, sample_program
from evaps.models import METHODS, method_class, new_method
from evaps.models.base import Synthesizer
from evaps.models.beam import beam_search
from evaps.models.inferred_trace import STOP, Ways
from evaps.train.lessons import Lessons

SYNTHESIZERS = [
    name
    for name, kind in METHODS.items()
    if kind.start is None and issubclass(method_class(name), Synthesizer)  # another name of the same network
]


def batch(programs: list[list[int]]) -> tuple[torch.Tensor, torch.Tensor]:
    return Lessons.of(programs).batch(range(len(programs)))


def told(model: Synthesizer, features: torch.Tensor) -> torch.Tensor | Ways:
    """What a method is told; one that acts went from the first view to the goal in one step."""
    if not model.acts:
        return features
    shape = features.shape[:3]
    perceived = torch.zeros(*shape, len(PERCEPTION_KEYS))
    actions = torch.tensor([0, STOP]).expand(shape)
    return Ways(features, perceived, actions, torch.ones(shape, dtype=torch.bool), features[:, :, 1])


@pytest.fixture
def programs() -> list[list[int]]:
    rng = np.random.default_rng(0)
    return [VOCAB.encode(sample_program(rng).tokens) for _ in range(32)]


@pytest.fixture(params=SYNTHESIZERS)
def model(request: pytest.FixtureRequest) -> Synthesizer:
    torch.manual_seed(0)
    method = new_method(request.param, dropout=0.0).eval()
    assert isinstance(method, Synthesizer)
    return method


def test_loss_is_a_mean_over_tokens_whatever_the_padding(
    model: Synthesizer, programs: list[list[int]]
) -> None:
    features = torch.randn(32, 5, 2, 256)
    together = model.loss(told(model, features), *batch(programs))
    rows = enumerate(programs)
    each = [model.loss(told(model, features[i : i + 1]), *batch([p])) * len(p) for i, p in rows]
    alone = sum(each) / sum(map(len, programs))
    torch.testing.assert_close(together, alone, rtol=1e-4, atol=1e-5)


def test_the_order_of_pairs_does_not_matter(model: Synthesizer, programs: list[list[int]]) -> None:
    features = torch.randn(32, 5, 2, 256)
    shuffled = features[:, torch.randperm(5)]
    losses = [model.loss(told(model, x), *batch(programs)) for x in (features, shuffled)]
    torch.testing.assert_close(*losses)


def test_a_pair_that_is_told_twice_counts_once(model: Synthesizer, programs: list[list[int]]) -> None:
    """Pairs are max-pooled, where a mean would weigh it more; but the Transformer attends to all of them."""
    features = torch.randn(32, 5, 2, 256)
    twice = features[:, [0, 1, 2, 3, 4, 0]]
    once, more = (model.logits(told(model, x), batch(programs)[0]) for x in (features, twice))
    assert torch.allclose(once, more, rtol=1e-4, atol=1e-4) == (model.name != "transformer")


def test_stepwise_decoding_scores_a_program_as_the_loss_does(
    model: Synthesizer, programs: list[list[int]]
) -> None:
    features = told(model, torch.randn(1, 5, 2, 256))
    tokens, masks = batch(programs[:1])
    state, last, total = model.start(features), None, 0.0
    for i, token in enumerate(programs[0]):
        logits, state = model.step(state, last, None)
        scores = logits.masked_fill(~masks[:, i], -torch.inf).log_softmax(-1)
        total, last = total - scores[0, token].item(), torch.tensor([token])
    (score,) = model.log_probabilities(features, tokens, masks).tolist()
    assert -total == pytest.approx(score, rel=1e-4)


def test_beam_search_finds_all_short_programs_in_order(model: Synthesizer) -> None:
    features = told(model, torch.randn(2, 5, 2, 256))
    for proposals in beam_search(model, features, beam=20, max_tokens=5):
        assert len({p.program for p in proposals}) == 7  # DEF run m( ACTION m)
        scores = [p.log_probability for p in proposals]
        assert scores == sorted(scores, reverse=True)
        assert sum(np.exp(scores)) == pytest.approx(1.0, abs=1e-4)


def test_beam_search_of_several_tasks_equals_one_by_one(model: Synthesizer) -> None:
    features = torch.randn(3, 5, 2, 256)
    together = beam_search(model, told(model, features), beam=6, max_tokens=16)
    for i, group in enumerate(together):
        alone = beam_search(model, told(model, features[i : i + 1]), beam=6, max_tokens=16)[0]
        assert [p.program for p in alone] == [p.program for p in group]


@pytest.mark.slow
@pytest.mark.parametrize("name", SYNTHESIZERS)
def test_it_can_learn_32_tasks_by_heart(name: str, programs: list[list[int]]) -> None:
    torch.manual_seed(0)
    model = new_method(name, feature=32, pair=64, hidden=128, dropout=0.0)
    assert isinstance(model, Synthesizer)
    features = told(model, F.normalize(torch.randn(32, 5, 2, 32), dim=-1) * 4)
    tokens, masks = batch(programs)
    optimizer = torch.optim.Adam(model.parameters(), lr=2e-3)
    for _ in range(80):
        optimizer.zero_grad()
        model.loss(features, tokens, masks).backward()
        torch.nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimizer.step()
    best = [group[0].program for group in beam_search(model.eval(), features, beam=2)]
    right = [VOCAB.encode(p.tokens) == gold for p, gold in zip(best, programs, strict=True)]
    assert np.mean(right) >= 0.95
