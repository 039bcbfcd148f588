"""Edits one after the other: what is learned leads to the target; whatever is decoded parses."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from evaps.dsl import Program
from evaps.dsl.mutation import mutate
from evaps.dsl.sampler import MAX_TOKENS, sample_program
from evaps.models.edit_steps import EditSteps
from evaps.models.sequential_edits import Edited, Lesson, SequentialEdits, edits_between

SEEDS = st.integers(0, 2**32 - 1)


def two_programs(seed: int, times: int) -> tuple[Program, Program]:
    rng = np.random.default_rng(seed)
    target = sample_program(rng)
    return (mutate(target, rng, times) if times else sample_program(rng)), target


@settings(deadline=None, max_examples=60)
@given(SEEDS, st.integers(0, 3))
def test_the_edits_between_two_programs_are_allowed_and_lead_from_one_to_the_other(
    seed: int, times: int
) -> None:
    before, after = two_programs(seed, times)
    partial = Edited.start(before)
    for choice in edits_between(before, after):
        assert not partial.finished
        assert partial.allowed()[choice]
        partial = partial.advance(choice)
    assert partial.finished
    assert Program.from_ids(partial.tokens) == after


@settings(deadline=None, max_examples=60)
@given(SEEDS)
def test_any_allowed_edits_end_in_a_program_of_allowed_length(seed: int) -> None:
    rng = np.random.default_rng(seed)
    partial = Edited.start(sample_program(rng))
    while not partial.finished:
        allowed = np.flatnonzero(partial.allowed())
        assert len(allowed) > 0
        partial = partial.advance(int(rng.choice(allowed)))
    assert tuple(Program.from_ids(partial.tokens).token_ids) == partial.tokens
    assert len(partial.tokens) <= MAX_TOKENS


def test_a_lesson_says_where_each_edit_happens() -> None:
    before = Program.parse("DEF run m( MOVE_LEFT TURN_LEFT m)")
    after = Program.parse("DEF run m( MOVE_LEFT ATTACK TURN_RIGHT m)")
    lesson = Lesson.of(before, after)
    assert lesson.pointers[:4] == [0, 1, 2, 3]
    assert lesson.pointers[-1] == len(before.tokens) - 1
    assert len(lesson.choices) == len(lesson.masks) == len(before.tokens) + 1


def test_programs_are_decoded_together_as_alone_and_each_comes_once() -> None:
    torch.manual_seed(0)
    head = SequentialEdits(16, 32, last_token=True).eval()
    programs = [two_programs(seed, 0)[0] for seed in range(3)]
    memory = torch.randn(3, 5, max(len(p.tokens) for p in programs), 16)
    together = [list(found) for found in head.decode(memory, programs, beam=6)]
    for i, program in enumerate(programs):
        assert len(set(together[i])) == len(together[i])
        alone = head.decode(memory[i : i + 1], [program], beam=6)[0]
        assert list(alone) == together[i]


@pytest.mark.parametrize("last_token", [False, True])
def test_a_step_at_a_time_gives_the_same_as_all_at_once(last_token: bool) -> None:
    torch.manual_seed(0)
    head = SequentialEdits(16, 32, layers=2, last_token=last_token).eval()
    torch.nn.init.normal_(head.output.weight)
    pairs = [two_programs(seed, 1) for seed in range(3)]
    befores, afters = zip(*pairs, strict=True)
    memory = torch.randn(3, 5, max(len(p.tokens) for p in befores), 16)
    told = head.targets(befores, afters, torch.device("cpu")).told
    with torch.inference_mode():
        expected = head(memory, told)
        steps = EditSteps(head, memory)
        order = torch.tensor([2, 0, 1])
        for time in range(expected.shape[1]):
            found = steps.step(
                *(each[:, time][steps.owner] for each in (told.last, told.written, told.pointers))
            )
            torch.testing.assert_close(found, expected[:, time][steps.owner], rtol=1e-4, atol=1e-5)
            steps.select(order)  # as a beam does
