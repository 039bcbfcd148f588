"""Programs that leave do, asked and told the same, what they do here."""

import contextlib
from collections.abc import Callable, Sequence
from typing import Any
from xml.etree import ElementTree as Xml

import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_programs import programs

from evaps.dsl import Limits, Program, run
from evaps.dsl.errors import UserError
from evaps.dsl.export import to_behavior_tree, to_function

PATIENCE = 60
Log = list[tuple[str, str]]


class Tired(Exception):  # noqa: N818 - it is no error
    """The robot has been asked and told often enough."""


class Recorder:
    """Answers from a list, over and over, and keeps what it was asked and told."""

    def __init__(self, answers: Sequence[bool]) -> None:
        self.answers, self.log, self.asked = answers, Log(), 0

    def act(self, action: str) -> None:
        self._note("act", action)

    def perceive(self, perception: str) -> bool:
        self._note("perceive", perception)
        self.asked += 1
        return self.answers[(self.asked - 1) % len(self.answers)]

    def observe(self) -> None:
        return None

    def _note(self, kind: str, word: str) -> None:
        if len(self.log) == PATIENCE:
            raise Tired
        self.log.append((kind, word))


def log_of(play: Callable[[Recorder], Any], answers: Sequence[bool]) -> Log:
    robot = Recorder(answers)
    with contextlib.suppress(Tired):
        play(robot)
    return robot.log


def tick(node: Xml.Element, robot: Recorder) -> bool:
    """What BehaviorTree.CPP's manual says of these nodes, for actions that never run on: True is SUCCESS."""
    children = list(node)
    if node.tag == "Sequence":
        return all(tick(child, robot) for child in children)
    if node.tag == "IfThenElse":
        return tick(children[1 if tick(children[0], robot) else 2], robot)
    if node.tag == "Repeat":
        return all(tick(children[0], robot) for _ in range(int(node.attrib["num_cycles"])))
    if node.tag == "KeepRunningUntilFailure":
        while tick(children[0], robot):
            pass
        return False
    if node.tag == "ForceSuccess":
        tick(children[0], robot)
        return True
    if node.tag == "Inverter":
        return not tick(children[0], robot)
    if node.tag == "Perceive":
        return robot.perceive(node.attrib["perception"])
    if node.tag == "Act":
        robot.act(node.attrib["action"])
    else:
        assert node.tag == "AlwaysSuccess"
    return True


def play_function(program: Program) -> Callable[[Recorder], Any]:
    space: dict[str, Any] = {}
    exec(to_function(program), space)
    return space["run"]


def play_tree(program: Program) -> Callable[[Recorder], Any]:
    tree = Xml.fromstring(to_behavior_tree(program)).find("BehaviorTree")
    assert tree is not None
    return lambda robot: tick(tree[0], robot)


@given(programs, st.lists(st.booleans(), min_size=1, max_size=6))
def test_all_forms_ask_and_do_the_same(program: Program, answers: list[bool]) -> None:
    here = log_of(lambda robot: run(program, robot, Limits(10**6, 10**6)), answers)
    assert log_of(play_function(program), answers) == here
    assert log_of(play_tree(program), answers) == here


def test_the_function_is_code_that_people_can_read() -> None:
    program = Program.parse("DEF run m( WHILE c( not c( INTARGET Demon c) c) w( TURN_LEFT w) ATTACK m)")
    code = to_function(program)
    assert code.endswith(
        "def run(robot):\n"
        '    while not robot.perceive("INTARGET Demon"):\n'
        '        robot.act("TURN_LEFT")\n'
        '    robot.act("ATTACK")\n'
    )


@pytest.mark.parametrize("write", [to_function, to_behavior_tree])
def test_what_is_nested_too_deep_is_told(write: Callable[[Program], str]) -> None:
    deep = 2000
    program = Program.parse(
        " ".join(["DEF run m(", *["REPEAT R=2 r("] * deep, "ATTACK", *["r)"] * deep, "m)"])
    )
    with pytest.raises(UserError):
        write(program)


def test_the_tree_names_what_the_robot_has_to_have() -> None:
    root = Xml.fromstring(to_behavior_tree(Program.parse("DEF run m( ATTACK m)")))
    assert root.attrib == {"BTCPP_format": "4", "main_tree_to_execute": "run"}
    assert [node.attrib["ID"] for node in root.find("TreeNodesModel") or []] == ["Act", "Perceive"]
