"""Random programs: valid, as long as allowed, and the same from the same seed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaps.dsl import IfElse, Perception, Program
from evaps.dsl.sampler import ACTIONS, COUNTS, PERCEPTION_KEYS, PERCEPTIONS, SamplerConfig, sample_program

SEEDS = st.integers(0, 2**32 - 1)
CONDITIONALS = {"IF", "IFELSE", "WHILE"}


def conditions(program: Program) -> int:
    return sum(token in CONDITIONALS for token in program.tokens)


def test_the_words_are_those_of_the_language() -> None:
    assert sorted(ACTIONS) == sorted(
        ["MOVE_FORWARD", "MOVE_BACKWARD", "MOVE_LEFT", "MOVE_RIGHT", "TURN_LEFT", "TURN_RIGHT", "ATTACK"]
    )
    assert COUNTS == (2, 3, 4, 5, 6)
    monsters = ("Demon", "HellKnight", "Revenant")
    assert sorted(PERCEPTION_KEYS) == sorted(f"{a} {m}" for a in ("ISTHERE", "INTARGET") for m in monsters)


@given(SEEDS)
def test_a_random_program_is_one_and_fits(seed: int) -> None:
    program = sample_program(np.random.default_rng(seed))
    assert Program.parse(str(program)) == program
    assert len(program.tokens) <= 32
    for segment in program.segments:
        if isinstance(segment.node, IfElse):
            assert segment.node.body != segment.node.orelse


@given(SEEDS, st.integers(0, 3))
def test_it_has_as_many_conditions_as_asked_for(seed: int, wanted: int) -> None:
    assert conditions(sample_program(np.random.default_rng(seed), conditionals=wanted)) == wanted


@given(SEEDS)
def test_the_same_seed_gives_the_same_program(seed: int) -> None:
    a, b = (np.random.default_rng(seed) for _ in range(2))
    assert [sample_program(a) for _ in range(3)] == [sample_program(b) for _ in range(3)]


@given(SEEDS)
def test_conditions_ask_only_what_they_may(seed: int) -> None:
    only = (Perception("ISTHERE", "Demon"),)
    program = sample_program(np.random.default_rng(seed), perceptions=only, conditionals=2)
    assert program.tokens.count("ISTHERE") == program.tokens.count("Demon") == 2


@given(SEEDS, st.integers(5, 16))
def test_length_and_shape_can_be_configured(seed: int, length: int) -> None:
    config = SamplerConfig(max_tokens=length, conditionals=(1.0,), repeat=0.0)
    program = sample_program(np.random.default_rng(seed), config)
    assert len(program.tokens) <= length
    assert set(program.tokens[3:-1]) <= set(ACTIONS)


def test_shares_are_those_of_the_configuration() -> None:
    rng = np.random.default_rng(0)
    programs = [sample_program(rng) for _ in range(4000)]
    counts = np.bincount([conditions(program) for program in programs], minlength=3) / len(programs)
    assert counts[0] == pytest.approx(0.15, abs=0.03)
    assert counts[1] == pytest.approx(0.6, abs=0.03)
    assert counts[2] == pytest.approx(0.25, abs=0.03)
    tokens = [token for program in programs for token in program.tokens]
    asked = sum(map(tokens.count, ("ISTHERE", "INTARGET")))
    assert tokens.count("not") / asked == pytest.approx(0.5, abs=0.03)
    share = [tokens.count(action) for action in ACTIONS]
    assert max(share) < 1.15 * min(share)
    assert all(any(p.key in str(program) for program in programs) for p in PERCEPTIONS)
