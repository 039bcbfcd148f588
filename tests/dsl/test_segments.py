from hypothesis import given
from random_programs import programs

from evaps.dsl import If, IfElse, Program, Repeat, While

#        0   1   2  3     4  5   6  7        8     9  10 11 12        13 14
WHILE = "DEF run m( WHILE c( not c( INTARGET Demon c) c) w( TURN_LEFT w) ATTACK m)"
#         0   1   2  3      4  5       6          7  8  9         10 11   12 13     14  15 16     17 18 19 20
IFELSE = "DEF run m( IFELSE c( ISTHERE HellKnight c) i( MOVE_LEFT i) ELSE e( REPEAT R=3 r( ATTACK r) e) m)"


def chain(length):
    return {(i, i + 1) for i in range(length - 1)}


def shape(program):
    return [(s.index, type(s.node).__name__, s.parent, s.start, s.stop) for s in program.segments]


def test_segments_of_a_while():
    program = Program.parse(WHILE)
    assert shape(program) == [
        (0, "Program", None, 0, 16),
        (1, "While", 0, 3, 14),
        (2, "Action", 1, 12, 13),
        (3, "Action", 0, 14, 15),
    ]
    assert program.token_segments == (0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1, 1, 2, 1, 3, 0)
    assert program.python_lines == (
        (0, "def run():"),
        (1, "    while not in_target(Demon):"),
        (2, "        turn_left()"),
        (3, "    attack()"),
    )


def test_segments_of_an_ifelse():
    program = Program.parse(IFELSE)
    assert shape(program) == [
        (0, "Program", None, 0, 20),
        (1, "IfElse", 0, 3, 19),
        (2, "Action", 1, 9, 10),
        (3, "Repeat", 1, 13, 18),
        (4, "Action", 3, 16, 17),
    ]
    assert program.token_segments == (0, 0, 0, 1, 1, 1, 1, 1, 1, 2, 1, 1, 1, 3, 3, 3, 4, 3, 1, 0)
    assert [segment for segment, _ in program.python_lines] == [0, 1, 2, 1, 3, 4]
    assert program.python_lines[3] == (1, "    else:")


def test_edges_join_neighbours_and_conditions():
    assert set(Program.parse(WHILE).edges) == chain(16) | {(3, 5)}
    # REPEAT is next to its R=n already: its left pointer adds nothing
    assert set(Program.parse(IFELSE).edges) == chain(20) | {(3, 5)}
    nested = Program.parse(
        "DEF run m( IF c( ISTHERE Demon c) i( WHILE c( ISTHERE Demon c) w( ATTACK w) i) m)"
    )
    assert set(nested.edges) == chain(len(nested.tokens)) | {(3, 5), (9, 11)}


@given(programs)
def test_edges_are_simple_and_one_more_for_each_condition(program):
    conditions = sum(isinstance(s.node, If | IfElse | While) for s in program.segments)
    assert len(set(program.edges)) == len(program.edges) == len(program.tokens) - 1 + conditions
    assert all(0 <= i < j < len(program.tokens) for i, j in program.edges)
    assert list(program.edges) == sorted(program.edges)


@given(programs)
def test_tokens_belong_to_their_innermost_segment(program):
    owners = [
        max(s.index for s in program.segments if s.start <= i < s.stop) for i in range(len(program.tokens))
    ]
    assert list(program.token_segments) == owners


@given(programs)
def test_segments_nest_in_the_order_of_their_tokens(program):
    segments = program.segments
    assert segments[0].node is program
    assert [s.index for s in segments] == list(range(len(segments)))
    assert [s.start for s in segments] == sorted(s.start for s in segments)
    for segment in segments[1:]:
        parent = segments[segment.parent]
        assert parent.start < segment.start < segment.stop < parent.stop
        block = program.tokens[segment.start : segment.stop]
        assert Program.from_tokens(["DEF", "run", "m(", *block, "m)"]).body == (segment.node,)


@given(programs)
def test_lines_show_each_segment_once_and_an_ifelse_twice(program):
    shown = [segment for segment, _ in program.python_lines]
    expected = [s.index for s in program.segments]
    expected += [s.index for s in program.segments if isinstance(s.node, IfElse)]
    assert sorted(shown) == sorted(expected)
    for segment, line in program.python_lines:
        if isinstance(program.segments[segment].node, Repeat):
            assert line.strip() == f"for _ in range({program.segments[segment].node.times}):"
