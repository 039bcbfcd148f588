import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_programs import NAMES, programs

from evaps.dsl import TOKEN_TYPES, VOCAB, GrammarState, Program, token_type

KINDS = {
    "pad": ["<pad>"],
    "action": NAMES,
    "perception": ["ISTHERE", "INTARGET"],
    "control": ["DEF", "run", "IF", "IFELSE", "ELSE", "WHILE", "REPEAT", "not"],
    "bracket": ["m(", "m)", "c(", "c)", "i(", "i)", "e(", "e)", "w(", "w)", "r(", "r)"],
    "constant": ["Demon", "HellKnight", "Revenant", "R=2", "R=3", "R=4", "R=5", "R=6"],
}


def after(text):
    state = GrammarState.start()
    for token_id in VOCAB.encode(text.split()):
        state = state.advance(token_id)
    return state


def allowed(mask):
    return set(VOCAB.decode(np.flatnonzero(mask)))


def test_vocabulary_is_the_language():
    assert set(TOKEN_TYPES) == set(KINDS)
    assert {t: token_type(t) for t in VOCAB.tokens} == {t: kind for kind, ts in KINDS.items() for t in ts}
    assert len(VOCAB) == len(VOCAB.tokens) == 38


def test_order_is_by_type_then_name():
    assert VOCAB.tokens[0] == "<pad>"
    assert list(VOCAB.tokens) == sorted(VOCAB.tokens, key=lambda t: (TOKEN_TYPES.index(token_type(t)), t))
    assert [VOCAB.ids[token] for token in VOCAB.tokens] == list(range(38))


@given(programs)
def test_encoding_round_trips(program):
    assert tuple(VOCAB.decode(VOCAB.encode(program.tokens))) == program.tokens


def test_unknown_tokens_and_ids_are_refused():
    with pytest.raises(ValueError, match="JUMP"):
        VOCAB.encode(["JUMP"])
    with pytest.raises(ValueError, match="JUMP"):
        token_type("JUMP")
    for bad in (-1, 38):
        with pytest.raises(ValueError, match="37"):
            VOCAB.decode([bad])
        with pytest.raises(ValueError, match="not allow"):
            GrammarState.start().advance(bad)


STATEMENT = {*NAMES, "IF", "IFELSE", "WHILE", "REPEAT"}
MASKS = [
    ("", {"DEF"}, 5),
    ("DEF run m(", STATEMENT, 2),
    ("DEF run m( ATTACK", {*STATEMENT, "m)"}, 1),
    ("DEF run m( ATTACK m)", set(), 0),
    ("DEF run m( WHILE", {"c("}, 8),
    ("DEF run m( WHILE c(", {"ISTHERE", "INTARGET", "not"}, 7),
    ("DEF run m( WHILE c( not", {"c("}, 9),
    ("DEF run m( WHILE c( not c( ISTHERE", {"Demon", "HellKnight", "Revenant"}, 7),
    ("DEF run m( WHILE c( not c( ISTHERE Demon c)", {"c)"}, 5),
    ("DEF run m( REPEAT", {"R=2", "R=3", "R=4", "R=5", "R=6"}, 5),
    ("DEF run m( IFELSE", {"c("}, 12),
    ("DEF run m( REPEAT R=2 r( IFELSE c( ISTHERE Demon c) i( ATTACK", {*STATEMENT, "i)"}, 7),
]


@pytest.mark.parametrize(("text", "tokens", "shortest"), MASKS)
def test_masks_and_shortest_ends_worked_out_by_hand(text, tokens, shortest):
    state = after(text)
    assert allowed(state.allowed) == tokens
    assert state.shortest == shortest
    assert state.finished is (shortest == 0)
    assert not state.allowed_within(shortest - 1).any()
    for token in set(VOCAB.tokens) - tokens:
        with pytest.raises(ValueError, match="not allow"):
            state.advance(VOCAB.ids[token])


def test_allowed_within_leaves_room_for_the_end():
    state = after("DEF run m(")
    assert allowed(state.allowed_within(2)) == set(NAMES)
    assert allowed(state.allowed_within(5)) == set(NAMES)
    assert allowed(state.allowed_within(6)) == {*NAMES, "REPEAT"}
    assert allowed(state.allowed_within(9)) == {*NAMES, "REPEAT", "IF", "WHILE"}
    assert allowed(state.allowed_within(13)) == STATEMENT


@given(programs)
def test_masks_never_forbid_a_program(program):
    state, ids = GrammarState.start(), VOCAB.encode(program.tokens)
    for place, token_id in enumerate(ids):
        assert state.allowed_within(len(ids) - place)[token_id]
        assert state.shortest <= len(ids) - place
        assert not state.finished
        assert (state.allowed_within(10**6) == state.allowed).all()
        state = state.advance(token_id)
    assert state.finished


@given(st.integers(5, 40), st.randoms(use_true_random=False))
def test_walks_through_the_masks_end_in_a_program_in_time(limit, random):
    state, ids = GrammarState.start(), []
    while not state.finished:
        mask = state.allowed_within(limit - len(ids))
        assert not mask[0]
        assert not (mask & ~state.allowed).any()
        ids.append(random.choice(np.flatnonzero(mask).tolist()))
        state = state.advance(ids[-1])
    assert len(ids) <= limit
    assert Program.from_ids(ids).tokens == tuple(VOCAB.decode(ids))


@given(programs, st.data())
def test_what_a_mask_forbids_does_not_parse(program, data):
    """The shortest way on from an allowed token is a program; a forbidden token is an error at that place."""
    place = data.draw(st.integers(0, len(program.tokens) - 1))
    state = after(" ".join(program.tokens[:place]))
    token = data.draw(st.sampled_from(VOCAB.tokens[1:]))
    tokens = [*program.tokens[:place], token]
    if not state.allowed[VOCAB.ids[token]]:
        with pytest.raises(ValueError, match=f'found "{token}"'.replace("(", r"\(").replace(")", r"\)")):
            Program.from_tokens(tokens)
        return
    state = state.advance(VOCAB.ids[token])
    length = len(tokens) + state.shortest
    while not state.finished:
        token_id = int(np.flatnonzero(state.allowed_within(length - len(tokens)))[0])
        tokens.append(VOCAB.tokens[token_id])
        state = state.advance(token_id)
    assert len(Program.from_tokens(tokens).tokens) == length


def test_states_are_shared_and_masks_are_read_only():
    one, two = after("DEF run m( ATTACK ATTACK"), after("DEF run m( ATTACK TURN_LEFT ATTACK")
    assert one is two
    assert pickle.loads(pickle.dumps(one)) is one
    assert one.allowed_within(3) is one.allowed_within(3)
    for mask in (one.allowed, one.allowed_within(3)):
        assert mask.dtype == np.bool_
        assert mask.shape == (38,)
        with pytest.raises(ValueError, match="read-only"):
            mask[0] = True
