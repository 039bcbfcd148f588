import pickle
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_programs import programs

from evaps.dsl import (
    Action,
    If,
    IfElse,
    Not,
    Perception,
    Program,
    ProgramError,
    Repeat,
    While,
)

DEMON = Perception("INTARGET", "Demon")

EXAMPLES = [
    (
        "DEF run m( WHILE c( not c( INTARGET Demon c) c) w( TURN_LEFT w) ATTACK m)",
        "def run():\n    while not in_target(Demon):\n        turn_left()\n    attack()\n",
        (While(Not(DEMON), (Action("TURN_LEFT"),)), Action("ATTACK")),
    ),
    (
        "DEF run m( IFELSE c( ISTHERE HellKnight c) i( MOVE_LEFT i) ELSE e( REPEAT R=3 r( ATTACK r) e) m)",
        "def run():\n    if is_there(HellKnight):\n        move_left()\n    else:\n"
        "        for _ in range(3):\n            attack()\n",
        (
            IfElse(
                Perception("ISTHERE", "HellKnight"),
                (Action("MOVE_LEFT"),),
                (Repeat(3, (Action("ATTACK"),)),),
            ),
        ),
    ),
    (
        "DEF run m( IF c( not c( not c( ISTHERE Revenant c) c) c) i( MOVE_FORWARD TURN_RIGHT i) m)",
        "def run():\n    if not not is_there(Revenant):\n        move_forward()\n        turn_right()\n",
        (
            If(
                Not(Not(Perception("ISTHERE", "Revenant"))),
                (Action("MOVE_FORWARD"), Action("TURN_RIGHT")),
            ),
        ),
    ),
]


@pytest.mark.parametrize(("tokens", "python", "body"), EXAMPLES)
def test_both_forms_of_an_example(tokens, python, body):
    program = Program(body)
    assert str(program) == tokens
    assert program.to_python() == python
    assert Program.parse(tokens) == Program.parse(python) == Program.from_tokens(tokens.split()) == program


@given(programs)
def test_both_forms_round_trip(program):
    assert Program.parse(str(program)) == program
    assert Program.parse(program.to_python()) == program
    assert Program.from_tokens(program.tokens) == program
    assert hash(Program.parse(str(program))) == hash(program)
    assert str(program).split() == list(program.tokens)


@given(programs)
def test_python_form_is_python(program):
    compile(program.to_python(), "program", "exec")
    lines = program.to_python().splitlines()
    assert [line for _, line in program.python_lines] == lines


@given(programs, st.integers(0, 2**32))
def test_token_form_may_be_spread_over_lines(program, seed):
    rng = random.Random(seed)
    blanks = [" ", "\n", "\t", "\r\n", "   \n  ", "  # a note\n"]
    text = "".join(rng.choice(blanks) + token for token in program.tokens) + rng.choice(["", "\n", " # end"])
    assert Program.parse(text) == program


@given(programs, st.integers(0, 2**32))
def test_python_form_may_have_comments_and_any_indent(program, seed):
    rng = random.Random(seed)
    indent = rng.choice(["\t", " ", "  ", "       "])
    lines = ["# before: def", ""]
    for line in program.to_python().splitlines():
        depth = (len(line) - len(line.lstrip())) // 4
        lines += rng.choice([[], [""], ["     "], ["  # odd place"], ["# " * 5]])
        lines.append(indent * depth + line.strip() + rng.choice(["", "  ", "  # why: because"]))
    text = rng.choice(["\n", "\r\n"]).join(lines)
    compile(text, "program", "exec")
    assert Program.parse(text) == program


def test_blocks_nest_to_any_depth():
    depth = 400
    text = "DEF run m( " + "REPEAT R=2 r( " * depth + "ATTACK" + " r)" * depth + " m)"
    program = Program.parse(text)
    assert str(program) == text
    assert program.python_lines[-1] == (depth + 1, "    " * (depth + 1) + "attack()")


def test_caches_are_not_pickled():
    program = Program.parse(EXAMPLES[0][0])
    fresh = pickle.dumps(program)
    assert program.segments
    assert program.edges
    assert pickle.dumps(program) == fresh
    assert pickle.loads(fresh) == program


STATEMENT = ("an action", '"IF"', '"IFELSE"', '"WHILE"', '"REPEAT"')
PYTHON_STATEMENT = ("an action", '"if"', '"while"', '"for"')
END = "the end of the text"
BAD = [
    ("", 1, 1, END, ('"DEF"', '"def"')),
    (" \n # nothing\n", 2, 11, END, ('"DEF"', '"def"')),
    ("DEF run m( JUMP m)", 1, 12, '"JUMP"', STATEMENT),
    ("DEF run m( attack m)", 1, 12, '"attack"', STATEMENT),
    ("DEF run m( ATTACKATTACK m)", 1, 12, '"ATTACKATTACK"', STATEMENT),
    ("DEF run m( m)", 1, 12, '"m)"', STATEMENT),
    ("DEF run m( " + "x" * 50, 1, 12, '"' + "x" * 37 + '..."', STATEMENT),
    ("DEF run m( \u200b\n m)", 1, 12, '"\\u200b"', STATEMENT),
    ("DEF run\nm( REPEAT R=7 r( ATTACK r) m)", 2, 11, '"R=7"', ('"R=2", "R=3", "R=4", "R=5" or "R=6"',)),
    ("DEF run m( REPEAT ATTACK m)", 1, 19, '"ATTACK"', ('"R=2", "R=3", "R=4", "R=5" or "R=6"',)),
    ("DEF run m( ATTACK\n", 1, 18, END, (*STATEMENT, '"m)"')),
    ("DEF run m( ATTACK m) m)", 1, 22, '"m)"', ("the end of the program",)),
    ("DEF run m( ATTACK m) @", 1, 22, '"@"', ("the end of the program",)),
    ("DEF run m( IF c( ISTHERE Demon c) i( ATTACK w) m)", 1, 45, '"w)"', (*STATEMENT, '"i)"')),
    ("DEF run m( IF c( ATTACK c) i( ATTACK i) m)", 1, 18, '"ATTACK"', ("a perception", '"not"')),
    ("DEF run m( IF c( ISTHERE c) i( ATTACK i) m)", 1, 26, '"c)"', ('"Demon", "HellKnight" or "Revenant"',)),
    ("DEF run m( IFELSE c( ISTHERE Demon c) i( ATTACK i) m)", 1, 52, '"m)"', ('"ELSE"',)),
    ("WHILE c( ISTHERE Demon c) w( ATTACK w)", 1, 1, '"WHILE"', ('"DEF"', '"def"')),
    ("def run():", 1, 11, END, ("an indented block",)),
    ("def run():\n", 1, 11, END, ("an indented block",)),
    ("def run():\nattack()\n", 2, 1, '"attack"', ("an indented block",)),
    ("def run(): attack()", 1, 12, '"attack"', ("a new line",)),
    ("def run()\n    attack()", 1, 10, "the end of the line", ('":"',)),
    ("def\nrun():\n    attack()", 1, 4, "the end of the line", ('"run"',)),
    ("def run):\n    attack()", 1, 8, '")"', ('"("',)),
    ("def run():\n    attack(", 2, 12, END, ('")"',)),
    ("def run():\n    jump()\n", 2, 5, '"jump"', PYTHON_STATEMENT),
    ("def run():\n    ATTACK()\n", 2, 5, '"ATTACK"', PYTHON_STATEMENT),
    ("def run():\n    attacks()\n", 2, 5, '"attacks"', PYTHON_STATEMENT),
    ("def run():\n    for _ in range(7):\n", 2, 20, '"7"', ('"2", "3", "4", "5" or "6"',)),
    ("def run():\n    for _ in range(22):\n", 2, 20, '"22"', ('"2", "3", "4", "5" or "6"',)),
    ("def run():\n    while is_there(demon):\n", 2, 20, '"demon"', ('"Demon", "HellKnight" or "Revenant"',)),
    ("def run():\n    if is_there(Demon):\n", 2, 24, END, ("an indented block",)),
    ("def run():\n    if is_there(Demon):\n    attack()", 3, 5, '"attack"', ("an indented block",)),
    (
        "def run():\n    attack()\n\n    else:",
        4,
        5,
        '"else"',
        ("the end of the block", *PYTHON_STATEMENT),
    ),
    (
        "def run():\n    attack()\n      attack()",
        3,
        7,
        "an indentation",
        ("the end of the block", *PYTHON_STATEMENT),
    ),
    (
        "def run():\n    if is_there(Demon):\n        attack()\n      attack()\n",
        4,
        7,
        "an indentation that no line above has",
        ("that of a block above",),
    ),
    ("  def run():\n    attack()", 1, 3, "an indentation", ("a new line", '"def"')),
    ("def run():\n    attack()\nattack()", 3, 1, '"attack"', ("the end of the program",)),
]


@pytest.mark.parametrize(("text", "line", "column", "found", "expected"), BAD)
def test_errors_say_where_and_what(text, line, column, found, expected):
    with pytest.raises(ProgramError) as caught:
        Program.parse(text)
    error = caught.value
    assert (error.line, error.column, error.found) == (line, column, found)
    assert set(error.expected) == set(expected)
    message = str(error)
    assert message.startswith(f"line {line}, column {column}: found {found}, expected ")
    assert all(words in message for words in expected)
    assert message.isprintable()
    assert str(pickle.loads(pickle.dumps(error))) == message


def fault(text):
    try:
        Program.parse(text)
    except ProgramError as error:
        return error
    return None


@given(programs, st.data())
def test_a_program_with_one_token_less_or_more_is_a_program_or_an_error(program, data):
    tokens = list(program.tokens)
    place = data.draw(st.integers(0, len(tokens) - 1))
    if data.draw(st.booleans()):
        del tokens[place]
    else:
        tokens.insert(place, data.draw(st.sampled_from([*tokens, "m)", "JUMP", "("])))
    error = fault(" ".join(tokens))
    if error is None:
        assert Program.from_tokens(tokens).tokens == tuple(tokens)
    elif error.found != END:
        before = " ".join(tokens)[: error.column - 1].split()
        assert (error.line, error.found) == (1, f'"{tokens[len(before)]}"')


@given(st.text(alphabet="def run():\n\t\r #_atck@é\x0b\x0c\xa0", max_size=40))
def test_any_text_is_a_program_or_an_error(text):
    error = fault(text)
    assert error is None or 1 <= error.line <= text.count("\n") + 1


@given(programs, st.data())
def test_what_is_no_python_is_no_program(program, data):
    """Any text that the Python form accepts, Python accepts too."""
    text = program.to_python()
    place = data.draw(st.integers(0, len(text)))
    text = text[:place] + data.draw(st.sampled_from(["\n", " ", "\t", "#", "(", "\r", "\x0c"])) + text[place:]
    if fault(text) is None:
        compile(text, "program", "exec")


@pytest.mark.parametrize(
    "program",
    [
        Program(()),
        Program((If(DEMON, ()),)),
        Program((Action("JUMP"),)),
        Program((Repeat(7, (Action("ATTACK"),)),)),
        Program((If(Perception("ISTHERE", None), (Action("ATTACK"),)),)),
    ],
)
def test_trees_outside_the_language_have_no_text(program):
    with pytest.raises(ValueError, match=r"language|statement"):
        _ = program.tokens
    with pytest.raises(ValueError, match=r"language|statement"):
        program.to_python()
