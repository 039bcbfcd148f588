"""Edits: what is learned leads to the target, and whatever is decoded parses."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from evaps.dsl import VOCAB, Program
from evaps.dsl.alignment import align
from evaps.dsl.mutation import mutate
from evaps.dsl.sampler import MAX_TOKENS, sample_program
from evaps.models.parallel_edits import DELETE, SLOTS, decode_edits, edit_targets

SEEDS = st.integers(0, 2**32 - 1)


def certain(ids: np.ndarray) -> np.ndarray:
    """Log-probabilities that leave no doubt."""
    scores = np.full((*ids.shape, len(VOCAB)), -30.0, np.float32)
    np.put_along_axis(scores, ids[..., None], 0.0, -1)
    return scores


def random_scores(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Log-probabilities of which a few tokens have most."""
    return np.log(rng.dirichlet(np.full(len(VOCAB), 0.1), shape) + 1e-9).astype(np.float32)


def most_inserted(before: Program, after: Program) -> int:
    longest = run = 0
    for edit in align(before.tokens, after.tokens):
        run = run + 1 if edit.kind == "insert" else 0
        longest = max(longest, run)
    return longest


@settings(deadline=None, max_examples=60)
@given(SEEDS, st.integers(1, 3))
def test_certain_edits_lead_to_the_target(seed: int, times: int) -> None:
    rng = np.random.default_rng(seed)
    target = sample_program(rng)
    wrong = mutate(target, rng, times)
    if most_inserted(wrong, target) > SLOTS:
        return
    replace, insert = edit_targets(wrong, target)
    decoded = decode_edits(certain(np.array(replace)), certain(np.array(insert)), beam=8)
    assert next(decoded) == target


@settings(deadline=None, max_examples=15)
@given(SEEDS)
def test_whatever_is_decoded_is_a_program_of_allowed_length(seed: int) -> None:
    rng = np.random.default_rng(seed)
    length = len(sample_program(rng).tokens)
    for program in decode_edits(random_scores(rng, length), random_scores(rng, length, SLOTS), beam=8):
        assert Program.parse(str(program)) == program
        assert len(program.tokens) <= MAX_TOKENS


@settings(deadline=None, max_examples=60)
@given(SEEDS)
def test_substitution_always_finds_programs_of_the_same_length(seed: int) -> None:
    rng = np.random.default_rng(seed)
    length = len(sample_program(rng).tokens)
    replace = random_scores(rng, length)
    replace[:, DELETE] = -np.inf
    decoded = list(decode_edits(replace, np.zeros((length, 0, len(VOCAB)), np.float32), beam=4))
    assert decoded
    for program in decoded:
        assert Program.parse(str(program)) == program
        assert len(program.tokens) == length


@settings(deadline=None, max_examples=60)
@given(SEEDS, st.integers(1, 3))
def test_mutations_differ_and_fit(seed: int, times: int) -> None:
    rng = np.random.default_rng(seed)
    program = sample_program(rng)
    mutated = mutate(program, rng, times)
    assert mutated != program
    assert Program.parse(str(mutated)) == mutated
    assert len(mutated.tokens) <= MAX_TOKENS
