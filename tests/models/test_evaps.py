"""EVAPS: what a token's representation depends on, invariances, and that it can learn."""

from dataclasses import replace
from typing import Any, get_args

import numpy as np
import pytest
import torch

from evaps.dsl import TOKEN_TYPES, Program, token_type
from evaps.dsl.alignment import align
from evaps.dsl.mutation import mutate
from evaps.dsl.sampler import sample_program
from evaps.models.base import Execution
from evaps.models.evaps import Batch, EditMode, Evaps, EvapsConfig
from evaps.models.parallel_edits import SLOTS

CPU = torch.device("cpu")
EDITS = get_args(EditMode)
STEPS = 150
PROGRAM = Program.parse(
    "DEF run m( MOVE_LEFT IF c( ISTHERE Demon c) i( ATTACK i) TURN_LEFT TURN_RIGHT MOVE_RIGHT m)"
)


def execution(program: Program, rng: np.random.Generator, rows: int = 200) -> Execution:
    shape = (5, len(program.segments))
    seen = [rng.integers(0, rows, shape) for _ in range(2)]
    return Execution(program, *seen, *(rng.integers(0, rows, 5) for _ in range(3)))


def model(**flags: bool) -> Evaps:
    torch.manual_seed(0)
    return Evaps(EvapsConfig(**flags)).eval()


@pytest.fixture
def table() -> torch.Tensor:
    return torch.randn(200, 256, generator=torch.Generator().manual_seed(1))


@pytest.mark.parametrize("when", ["before", "after"])
def test_a_token_changes_with_its_own_segments_observations_and_only_then(
    when: str, table: torch.Tensor
) -> None:
    seen = execution(PROGRAM, np.random.default_rng(0))
    net = model(goal=False)
    as_it_was = net.represent(Batch.of([seen], CPU), table)[0]
    for segment in range(len(PROGRAM.segments)):
        other = getattr(seen, when).copy()
        other[2, segment] = (other[2, segment] + 1) % 200
        changes: Any = {when: other}
        as_it_is = net.represent(Batch.of([replace(seen, **changes)], CPU), table)[0]
        changed = (as_it_was != as_it_is).any(-1)
        own = torch.tensor(PROGRAM.token_segments) == segment
        assert torch.equal(changed[2], own)
        assert not changed[[0, 1, 3, 4]].any()


@pytest.mark.parametrize(
    ("flags", "known"),
    [
        ({}, {"before", "after", "first", "final", "goal"}),
        ({"graph": False}, {"before", "after", "first", "final", "goal"}),
        ({"observations": False}, {"first", "goal"}),
        ({"observations": False, "graph": False}, {"first", "goal"}),
        ({"goal": False}, {"before", "after"}),
    ],
)
def test_edits_depend_on_all_that_a_method_may_see_and_on_nothing_else(
    flags: dict[str, bool], known: set[str], table: torch.Tensor
) -> None:
    seen = execution(PROGRAM, np.random.default_rng(0))
    net = model(**flags)
    as_it_was = net(Batch.of([seen], CPU), table)
    for part in ("before", "after", "first", "final", "goal"):
        changes: Any = {part: (getattr(seen, part) + 1) % 200}
        as_it_is = net(Batch.of([replace(seen, **changes)], CPU), table)
        assert torch.equal(as_it_was, as_it_is) == (part not in known), part


def test_what_was_seen_is_the_equation_of_the_paper(table: torch.Tensor) -> None:
    """Eq. 2-3 written out: from before to after, and from there to the goal, for each segment and pair."""
    seen = execution(PROGRAM, np.random.default_rng(0))
    net = model()
    assert net.segment is not None
    found = net._observations(Batch.of([seen], CPU), table)
    for segment in range(len(PROGRAM.segments)):
        for pair in range(5):
            before, after, goal = (
                table[[row]]
                for row in (seen.before[pair, segment], seen.after[pair, segment], seen.goal[pair])
            )
            views = torch.cat([net.pair(before, after), net.pair(after, goal)], -1).relu()
            torch.testing.assert_close(found[segment, pair], net.segment(views).relu()[0])


def test_each_layer_of_the_graph_is_added_to_what_it_reads() -> None:
    net = model()
    batch = Batch.of([execution(PROGRAM, np.random.default_rng(0))], CPU)
    types = torch.tensor([TOKEN_TYPES.index(token_type(token)) for token in PROGRAM.tokens])
    nodes = net.token(batch.tokens[0]) + net.token_type(types)
    for layer in net.graph:
        nodes = nodes + torch.nn.functional.elu(layer(nodes, batch.edges))
    torch.testing.assert_close(net._symbols(batch)[0], nodes)


@pytest.mark.parametrize("flags", [{}, {"observations": False}, {"graph": False}])
def test_a_pair_that_is_told_twice_counts_once(flags: dict[str, bool], table: torch.Tensor) -> None:
    """Pairs are max-pooled: a mean would weigh it more."""
    seen = execution(PROGRAM, np.random.default_rng(0))
    keys = ("before", "after", "first", "final", "goal")
    twice = replace(seen, **{k: getattr(seen, k)[[0, 1, 2, 3, 4, 0]] for k in keys})
    net = model(**flags)
    once, more = (net(Batch.of([one], CPU), table) for one in (seen, twice))
    torch.testing.assert_close(once, more)


def test_its_graph_attention_is_the_equation_of_the_paper() -> None:
    """Brody et al., 2022: softmax over neighbours and oneself of a . leaky(W_l x_j + W_r x_i), in float64."""
    layer = model().double().graph[0]
    nodes, heads = len(PROGRAM.tokens), 4
    x = torch.randn(nodes, 256, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    edges = Batch.of([execution(PROGRAM, np.random.default_rng(0))], CPU).edges
    near = torch.eye(nodes, dtype=torch.bool)
    for a, b in PROGRAM.edges:
        near[a, b] = near[b, a] = True
    left, right = (lin(x).unflatten(1, (heads, -1)) for lin in (layer.lin_l, layer.lin_r))
    leaky = torch.nn.functional.leaky_relu(right[:, None] + left[None], 0.2)
    scores = (leaky * layer.att).sum(-1).masked_fill(~near[..., None], -torch.inf)
    expected = torch.einsum("ijh,jhc->ihc", scores.softmax(1), left).flatten(1) + layer.bias
    torch.testing.assert_close(layer(x, edges), expected, rtol=1e-10, atol=1e-12)


def test_what_never_ran_has_one_learned_vector(table: torch.Tensor) -> None:
    seen = execution(PROGRAM, np.random.default_rng(0))
    never = seen.before.copy()
    never[:, 3] = -1
    net = model(graph=False, goal=False)
    x = net.represent(Batch.of([replace(seen, before=never, after=never)], CPU), table)[0]
    own = torch.tensor(PROGRAM.token_segments) == 3
    assert torch.equal(x[:, own, 256:], net.never.expand_as(x[:, own, 256:]))


def test_neighbours_in_the_graph_influence_a_token_and_strangers_do_not() -> None:
    net = model(observations=False, goal=False)
    other = Program.parse(str(PROGRAM).replace("MOVE_RIGHT", "MOVE_BACKWARD"))
    position = PROGRAM.tokens.index("MOVE_RIGHT")
    rng = np.random.default_rng(0)
    a, b = (net._symbols(Batch.of([execution(p, rng)], CPU))[0] for p in (PROGRAM, other))
    near = {position}
    for _ in range(net.config.graph_layers):
        near |= {x for edge in PROGRAM.edges for x in edge if near & set(edge)}
    changed = {i for i in range(len(PROGRAM.tokens)) if not torch.equal(a[i], b[i])}
    assert changed == near


def test_without_the_graph_tokens_stand_alone() -> None:
    net = model(observations=False, goal=False, graph=False)
    other = Program.parse(str(PROGRAM).replace("MOVE_RIGHT", "MOVE_BACKWARD"))
    rng = np.random.default_rng(0)
    a, b = (net._symbols(Batch.of([execution(p, rng)], CPU))[0] for p in (PROGRAM, other))
    assert int((a != b).any(-1).sum()) == 1


@pytest.mark.parametrize(
    ("graph", "context", "changed"), [(False, False, 1), (True, False, 4), (True, True, 16)]
)
def test_how_far_a_token_is_heard(graph: bool, context: bool, changed: int, table: torch.Tensor) -> None:
    """Alone, along the graph for as many edges as it has layers, or by the LSTM in the whole program."""
    net = model(observations=False, goal=False, graph=graph, context=context)
    other = Program.parse(str(PROGRAM).replace("MOVE_RIGHT", "MOVE_BACKWARD"))
    a, b = (net(Batch.of([execution(p, np.random.default_rng(0))], CPU), table)[0] for p in (PROGRAM, other))
    assert int((a != b).any(-1).sum()) == changed


@pytest.mark.parametrize("flags", [{}, {"observations": False}, {"graph": False}, {"goal": False}])
def test_neither_the_order_of_pairs_nor_padding_matters(flags: dict[str, bool], table: torch.Tensor) -> None:
    rng = np.random.default_rng(0)
    seen = execution(PROGRAM, rng)
    longer = execution(max((sample_program(rng) for _ in range(20)), key=lambda p: len(p.tokens)), rng)
    net = model(**flags)
    alone = net(Batch.of([seen], CPU), table)
    order = rng.permutation(5)
    shuffled = replace(
        seen, **{k: getattr(seen, k)[order] for k in ("before", "after", "first", "final", "goal")}
    )
    together = net(Batch.of([longer, shuffled], CPU), table)
    torch.testing.assert_close(alone[0], together[1, : len(PROGRAM.tokens)], rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("edits", EDITS)
def test_repairs_are_new_programs(edits: EditMode, table: torch.Tensor) -> None:
    seen = execution(PROGRAM, np.random.default_rng(0))
    torch.manual_seed(0)
    net = Evaps(EvapsConfig(edits=edits, beam=32)).eval()
    tried: set[Program] = set()
    for _ in range(3):
        (repaired,) = net.repair([seen], table, [tried])
        assert repaired is not None
        assert repaired not in tried
        tried.add(repaired)


def can_say(edits: EditMode, before: Program, after: Program) -> bool:
    kinds = [edit.kind for edit in align(before.tokens, after.tokens)]
    if edits == "substitution":
        return not {"insert", "delete"} & set(kinds)
    return kinds.count("insert") <= SLOTS


@pytest.mark.parametrize(
    ("edits", "flags"),
    [
        *((edits, {}) for edits in EDITS),
        ("sequential", {"observations": False}),
        ("sequential", {"graph": False}),
        ("sequential", {"observations": False, "graph": False}),
        ("sequential", {"goal": False}),
    ],
)
def test_it_can_learn_32_repairs_by_heart(edits: EditMode, flags: dict[str, bool]) -> None:
    torch.manual_seed(0)
    rng = np.random.default_rng(0)
    table = torch.randn(200, 32)
    pairs = [(mutate(p, rng), p) for p in (sample_program(rng) for _ in range(200))]
    pairs = [(w, p) for w, p in pairs if can_say(edits, w, p)][:32]
    targets = [p for _, p in pairs]
    wrong = [execution(w, rng) for w, _ in pairs]
    net = Evaps(EvapsConfig(feature=32, pair=64, hidden=64, dropout=0.0, edits=edits, **flags))
    batch = net.batch(wrong, targets, table.device)
    optimizer = torch.optim.Adam(net.parameters(), lr=2e-3)
    for _ in range(STEPS):
        optimizer.zero_grad()
        net.batch_loss(batch, table).backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimizer.step()
    repaired = net.eval().repair(wrong, table, [{e.program} for e in wrong])
    assert np.mean([r == t for r, t in zip(repaired, targets, strict=True)]) >= 0.95
