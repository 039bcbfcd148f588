"""SED: what a token's memory depends on, invariances, and that it can learn."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from evaps.dsl import Program
from evaps.dsl.mutation import mutate
from evaps.dsl.sampler import sample_program
from evaps.models.base import Execution
from evaps.models.sed import SED, SEDBatch, SEDConfig

CPU = torch.device("cpu")
PROGRAM = Program.parse("DEF run m( MOVE_LEFT IF c( ISTHERE Demon c) i( ATTACK i) TURN_LEFT m)")
EVENTS = 12


def execution(program: Program, rng: np.random.Generator, rows: int = 200) -> Execution:
    shape = (5, len(program.segments))
    seen = [rng.integers(0, rows, shape) for _ in range(2)]
    events = rng.integers(0, (5, len(program.segments), rows), (EVENTS, 3))
    return Execution(program, *seen, *(rng.integers(0, rows, 5) for _ in range(3)), events=events)


@pytest.fixture
def net() -> SED:
    torch.manual_seed(0)
    return SED().eval()


@pytest.fixture
def table() -> torch.Tensor:
    return torch.randn(200, 256, generator=torch.Generator().manual_seed(1))


def test_an_event_changes_the_tokens_of_its_segment_in_its_pair_and_no_other(
    net: SED, table: torch.Tensor
) -> None:
    seen = execution(PROGRAM, np.random.default_rng(0))
    before = net(SEDBatch.of([seen], CPU), table)[0]
    for number, (pair, segment, row) in enumerate(seen.events):
        events = seen.events.copy()
        events[number, 2] = (row + 1) % 200
        after = net(SEDBatch.of([replace(seen, events=events)], CPU), table)[0]
        changed = (before != after).any(-1)
        own = torch.tensor(PROGRAM.token_segments) == segment
        assert torch.equal(changed[pair], own)
        assert int(changed.sum()) == int(own.sum())


@pytest.mark.parametrize("part", ["first", "goal"])
def test_inputs_and_goals_are_seen_beside_the_program_and_at_each_event(
    part: str, net: SED, table: torch.Tensor
) -> None:
    seen = execution(PROGRAM, np.random.default_rng(0))
    rows, pair = getattr(seen, part).copy(), seen.events[0, 0]
    rows[pair] = (rows[pair] + 1) % 200
    batches = [SEDBatch.of([e], CPU) for e in (seen, replace(seen, **{part: rows}))]
    as_it_was, as_it_is = (net(batch, table)[0, ..., net.config.hidden :] for batch in batches)
    changed = (as_it_was != as_it_is).any(-1).all(-1)
    assert changed.tolist() == [other == pair for other in range(5)]
    as_it_was, as_it_is = (net.trace_embed(batch, table) for batch in batches)
    at_events = torch.zeros(as_it_was.shape[:2], dtype=torch.bool)
    at_events[seen.events[seen.events[:, 0] == pair][:, 1], pair] = True
    assert torch.equal((as_it_was != as_it_is).any(-1), at_events)


def test_where_nothing_was_executed_only_the_program_speaks(net: SED, table: torch.Tensor) -> None:
    seen = replace(execution(PROGRAM, np.random.default_rng(0)), events=np.zeros((0, 3), np.int64))
    traces = net.trace_embed(SEDBatch.of([seen], CPU), table)
    assert traces.shape == (len(PROGRAM.segments), 5, 256)
    assert not traces.any()


def test_neither_the_order_of_pairs_nor_padding_matters(net: SED, table: torch.Tensor) -> None:
    rng = np.random.default_rng(0)
    seen = execution(PROGRAM, rng)
    longer = execution(max((sample_program(rng) for _ in range(20)), key=lambda p: len(p.tokens)), rng)
    order = rng.permutation(5)
    events = seen.events.copy()
    events[:, 0] = np.argsort(order)[events[:, 0]]
    keys = ("before", "after", "first", "final", "goal")
    shuffled = replace(seen, **{k: getattr(seen, k)[order] for k in keys}, events=events)
    alone = net(SEDBatch.of([seen], CPU), table)[0]
    together = net(SEDBatch.of([longer, shuffled], CPU), table)[1, :, : len(PROGRAM.tokens)]
    torch.testing.assert_close(alone[torch.from_numpy(order)], together, rtol=1e-4, atol=1e-5)
    target = [Program.parse("DEF run m( ATTACK m)")]
    losses = [net.loss([one], target, table) for one in (seen, shuffled)]
    torch.testing.assert_close(*losses, rtol=1e-4, atol=1e-5)


def test_a_pair_that_is_told_twice_counts_once(net: SED, table: torch.Tensor) -> None:
    seen = execution(PROGRAM, np.random.default_rng(0))
    again = [0, 1, 2, 3, 4, 0]
    keys = ("before", "after", "first", "final", "goal")
    events = np.concatenate([seen.events, [[5, s, row] for pair, s, row in seen.events if pair == 0]])
    twice = replace(seen, **{k: getattr(seen, k)[again] for k in keys}, events=events)
    target = [Program.parse("DEF run m( ATTACK m)")]
    torch.testing.assert_close(*(net.loss([one], target, table) for one in (seen, twice)))


def test_rows_of_events_are_renumbered_with_the_others() -> None:
    seen = execution(PROGRAM, np.random.default_rng(0))
    used = np.unique(np.concatenate([rows.ravel() for rows in seen.rows()]))
    small = seen.renumbered(used)
    assert np.array_equal(used[small.events[:, 2]], seen.events[:, 2])
    assert np.array_equal(small.events[:, :2], seen.events[:, :2])


def test_it_can_learn_32_repairs_by_heart() -> None:
    torch.manual_seed(0)
    rng = np.random.default_rng(0)
    table = torch.randn(200, 32)
    targets = [sample_program(rng) for _ in range(32)]
    wrong = [execution(mutate(p, rng), rng) for p in targets]
    net = SED(SEDConfig(feature=32, pair=64, hidden=64, dropout=0.0))
    batch = net.batch(wrong, targets, table.device)
    optimizer = torch.optim.Adam(net.parameters(), lr=3e-3)
    for _ in range(120):
        optimizer.zero_grad()
        net.batch_loss(batch, table).backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimizer.step()
    repaired = net.eval().repair(wrong, table, [{e.program} for e in wrong])
    assert np.mean([r == t for r, t in zip(repaired, targets, strict=True)]) >= 0.95
