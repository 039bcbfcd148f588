"""Alignments: they lead from one sequence to the other, and no shorter one does."""

from functools import cache

import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_programs import programs

from evaps.dsl import Program
from evaps.dsl.alignment import Edit, align

words = st.lists(st.sampled_from("abc"), max_size=8)


def distance(a: tuple[str, ...], b: tuple[str, ...]) -> int:
    """Levenshtein's distance, straight from its definition."""

    @cache
    def rest(i: int, j: int) -> int:
        if i == len(a) or j == len(b):
            return len(a) - i + len(b) - j
        return min(rest(i + 1, j) + 1, rest(i, j + 1) + 1, rest(i + 1, j + 1) + (a[i] != b[j]))

    return rest(0, 0)


def check(before: tuple[str, ...], after: tuple[str, ...]) -> None:
    edits = align(before, after)
    assert tuple(e.old for e in edits if e.old is not None) == before
    assert tuple(e.new for e in edits if e.new is not None) == after
    assert sum(e.kind != "keep" for e in edits) == distance(before, after)


@given(words, words)
def test_the_fewest_edits_lead_from_one_to_the_other(before: list[str], after: list[str]) -> None:
    check(tuple(before), tuple(after))


@given(programs, programs)
def test_also_between_programs(before: Program, after: Program) -> None:
    check(before.tokens[:40], after.tokens[:40])


@given(words)
def test_what_is_equal_is_kept(word: list[str]) -> None:
    assert align(word, word) == [Edit(token, token) for token in word]


@given(words, words)
def test_no_edit_is_empty(before: list[str], after: list[str]) -> None:
    for edit in align(before, after):
        kinds = {(True, False): "insert", (False, True): "delete"}
        usual = "keep" if edit.old == edit.new else "replace"
        assert edit.kind == kinds.get((edit.old is None, edit.new is None), usual)
        assert (edit.old, edit.new) != (None, None)


@pytest.mark.parametrize(
    ("before", "after", "kinds"),
    [
        ("", "ab", "insert insert"),
        ("ab", "", "delete delete"),
        ("abc", "axc", "keep replace keep"),
        ("ac", "abc", "keep insert keep"),
        ("abc", "ac", "keep delete keep"),
        ("aa", "aaa", "keep keep insert"),
        ("ab", "ba", "replace replace"),
    ],
)
def test_by_hand(before: str, after: str, kinds: str) -> None:
    assert " ".join(edit.kind for edit in align(before, after)) == kinds
