"""What can be said of programs without running them."""

import math

import pytest
from hypothesis import given
from random_programs import programs

from evaps.dsl import Limits, Program, run
from evaps.dsl.counting import longest_run, programs_of_shape


class Anything:
    """A robot whose detectors answer in turns."""

    def __init__(self) -> None:
        self.asked = 0

    def act(self, action: str) -> None:
        pass

    def perceive(self, perception: str) -> bool:
        self.asked += 1
        return bool(self.asked % 3)

    def observe(self) -> None:
        return None


@given(programs)
def test_no_run_is_longer(program: Program) -> None:
    assert len(run(program, Anything(), Limits(actions=60, calls=400)).actions) <= longest_run(program)


@pytest.mark.parametrize(
    ("text", "longest", "alike"),
    [
        ("ATTACK", 1, 7),
        ("REPEAT R=4 r( ATTACK TURN_LEFT r)", 8, 5 * 49),
        ("IF c( ISTHERE Demon c) i( ATTACK i)", 1, 12 * 7),
        ("IFELSE c( not c( ISTHERE Demon c) c) i( ATTACK ATTACK i) ELSE e( ATTACK e) ATTACK", 3, 12 * 7**4),
        ("WHILE c( INTARGET Demon c) w( ATTACK w)", math.inf, 12 * 7),
    ],
)
def test_examples(text: str, longest: float, alike: int) -> None:
    program = Program.parse(f"DEF run m( {text} m)")
    assert (longest_run(program), programs_of_shape(program)) == (longest, alike)
