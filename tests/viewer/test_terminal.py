import re
from dataclasses import replace
from io import StringIO

import pytest
from rich.console import Console

from evaps.viewer.terminal import show_solution


@pytest.fixture
def shown(monkeypatch):
    """What is printed, with trailing spaces removed; in colours if asked for."""
    for name in ("NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE"):
        monkeypatch.delenv(name, raising=False)

    def show(report, colours=False):
        file = StringIO()
        system = "standard" if colours else None
        show_solution(Console(file=file, width=200, force_terminal=colours, color_system=system), report)
        return "".join(f"{line.rstrip()}\n" for line in file.getvalue().splitlines())

    return show


def test_a_solved_task(shown, repaired):
    text = shown(repaired)
    assert text.startswith("turn and shoot <b>& ")
    assert "solved  5/5 pairs  LGRL + EVAPS x2, 1.2 s" in text
    assert "round 1: 1/5 -> 3/5 pairs" in text
    assert "i( [-TURN_RIGHT-] {+TURN_LEFT+} i)" in text
    assert "{+REPEAT R=2 r(+} TURN_LEFT {+r)+}" in text
    program = repaired.solution.program.to_python()
    assert "".join(f"  {line}\n" for line in program.splitlines()) in text
    assert "other candidates" in text
    assert text.count(" LGRL ") >= 3


def test_what_was_right_at_once(shown, at_once):
    text = shown(at_once)
    assert "round" not in text
    assert "other candidates" not in text


def test_an_unsolved_task(shown, unsolved):
    assert "not solved  3/5 pairs" in shown(unsolved)


def test_colours_only_in_a_terminal(shown, repaired):
    assert "\x1b[" not in shown(repaired)
    text = shown(repaired, colours=True)
    assert "\x1b[9;31mTURN_RIGHT" in text
    assert "\x1b[1;32mTURN_LEFT" in text
    assert "[-" not in re.sub(r"\x1b\[[\d;]*m", "", text)


def test_what_a_search_has_found(shown, at_once):
    found = replace(at_once, solution=replace(at_once.solution, confidence=0.8125))
    assert "simulated actions, confidence 0.81" in shown(found)
