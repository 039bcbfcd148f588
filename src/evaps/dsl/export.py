"""Programs that leave: as a plain Python function, and as a behaviour tree."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree import ElementTree as Xml

from evaps.dsl.errors import UserError
from evaps.dsl.nodes import Action, Body, Condition, If, IfElse, Not, Repeat, Statement, While
from evaps.dsl.program import Program
from evaps.dsl.sampler import ACTIONS, PERCEPTION_KEYS

HEAD = f'''"""A robot program, written by evaps. It needs nothing but a robot with these two methods:

class Robot:
    def act(self, action: str) -> None: ...  # such as "{ACTIONS[-1]}"
    def perceive(self, perception: str) -> bool: ...  # such as "{PERCEPTION_KEYS[0]}"
"""


def run(robot):
'''


def to_function(program: Program) -> str:
    """A Python module with a function ``run(robot)``, which does what the program does.

    It has no limits: a loop that does not end does not end.

    Raises:
        UserError: the program is nested deeper than Python can be.
    """
    try:
        text = HEAD + "".join(f"    {line}\n" for line in _lines(program.body))
        compile(text, "program", "exec")
    except (SyntaxError, RecursionError, MemoryError) as error:
        raise UserError("Python cannot nest as deep as this program does; try: --to behavior-tree") from error
    return text


def _lines(body: Body) -> Iterator[str]:
    for statement in body:
        if isinstance(statement, Action):
            yield f'robot.act("{statement.name}")'
            continue
        yield f"{_head(statement)}:"
        yield from (f"    {line}" for line in _lines(statement.body))
        if isinstance(statement, IfElse):
            yield "else:"
            yield from (f"    {line}" for line in _lines(statement.orelse))


def _head(statement: If | IfElse | While | Repeat) -> str:
    if isinstance(statement, Repeat):
        return f"for _ in range({statement.times})"
    return f"{'while' if isinstance(statement, While) else 'if'} {_test(statement.condition)}"


def _test(condition: Condition) -> str:
    if isinstance(condition, Not):
        return f"not {_test(condition.condition)}"
    return f'robot.perceive("{condition.key}")'


def to_behavior_tree(program: Program) -> str:
    """XML of BehaviorTree.CPP, version 4, with two kinds of nodes that the robot has to have.

    ``Act`` executes ``action`` and succeeds, ``Perceive`` succeeds if ``perception`` is true. All else is of
    the library: ``Sequence``, ``IfThenElse``, ``Repeat``, ``Inverter``, ``AlwaysSuccess``, and for loops
    ``KeepRunningUntilFailure``, whose failure, that of its condition, ``ForceSuccess`` turns into a success.

    Raises:
        UserError: the program is nested by the hundreds.
    """
    try:
        return _behavior_tree(program)
    except RecursionError as error:
        raise UserError("this program is nested too deep for a behaviour tree to be written") from error


def _behavior_tree(program: Program) -> str:
    root = Xml.Element("root", BTCPP_format="4", main_tree_to_execute="run")
    _sequence(Xml.SubElement(root, "BehaviorTree", ID="run"), program.body)
    model = Xml.SubElement(root, "TreeNodesModel")
    Xml.SubElement(Xml.SubElement(model, "Action", ID="Act"), "input_port", name="action", type="std::string")
    perceive = Xml.SubElement(model, "Condition", ID="Perceive")
    Xml.SubElement(perceive, "input_port", name="perception", type="std::string")
    Xml.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"


def _sequence(parent: Xml.Element, body: Body) -> Xml.Element:
    sequence = Xml.SubElement(parent, "Sequence")
    for statement in body:
        _node(sequence, statement)
    return sequence


def _node(parent: Xml.Element, statement: Statement) -> None:
    if isinstance(statement, Action):
        Xml.SubElement(parent, "Act", action=statement.name)
    elif isinstance(statement, Repeat):
        _sequence(Xml.SubElement(parent, "Repeat", num_cycles=str(statement.times)), statement.body)
    elif isinstance(statement, While):
        loop = Xml.SubElement(Xml.SubElement(parent, "ForceSuccess"), "KeepRunningUntilFailure")
        turn = Xml.SubElement(loop, "Sequence")
        _condition(turn, statement.condition)
        _sequence(turn, statement.body)
    else:
        choice = Xml.SubElement(parent, "IfThenElse")
        _condition(choice, statement.condition)
        _sequence(choice, statement.body)
        if isinstance(statement, IfElse):
            _sequence(choice, statement.orelse)
        else:
            Xml.SubElement(choice, "AlwaysSuccess")  # without it, the node fails where the condition does


def _condition(parent: Xml.Element, condition: Condition) -> None:
    while isinstance(condition, Not):
        parent, condition = Xml.SubElement(parent, "Inverter"), condition.condition
    Xml.SubElement(parent, "Perceive", perception=condition.key)
