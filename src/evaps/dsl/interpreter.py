"""Running a program on a robot, and the trace that it leaves."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, NamedTuple, Protocol, TypeAlias, TypeVar

from evaps.dsl.nodes import Action, Condition, If, IfElse, Not, Perception, Repeat, Statement, While
from evaps.dsl.program import Program

O = TypeVar("O")  # noqa: E741 - the paper's letter for an observation
O_co = TypeVar("O_co", covariant=True)


class Robot(Protocol[O_co]):
    """Where a program runs."""

    def act(self, action: str) -> None:
        """Execute an action, such as ``TURN_LEFT``."""

    def perceive(self, perception: str) -> bool:
        """The answer of a detector to a `Perception.key`, such as ``ISTHERE Demon``, in the current view."""

    def observe(self) -> O_co:
        """The current observation."""


@dataclass(frozen=True)
class Limits:
    """How far a run may go.

    Args:
        actions: the most actions.
        calls: the most interpreter calls: one a statement executed, one an evaluated ``WHILE`` condition.
    """

    actions: int = 20
    calls: int = 100


class ActionEvent(NamedTuple):
    """An executed action: its segment, its name, and the number of actions executed before it."""

    segment: int
    action: str
    time: int


class ConditionEvent(NamedTuple):
    """An evaluated ``IF``, ``IFELSE`` or ``WHILE`` condition: its segment, itself, its value as a whole, and
    the number of actions executed before it.
    """

    segment: int
    condition: Condition
    value: bool
    time: int


Event: TypeAlias = ActionEvent | ConditionEvent


@dataclass(frozen=True)
class Trace(Generic[O]):
    """What happened in a run.

    Attributes:
        program: what ran.
        events: actions and conditions, in order.
        observations: before the first action and after each: one more than there are actions.
        halted: False if the run stopped at a limit.
        calls: interpreter calls made.
    """

    program: Program
    events: tuple[Event, ...]
    observations: tuple[O, ...]
    halted: bool
    calls: int

    @property
    def actions(self) -> tuple[str, ...]:
        """The names of the executed actions."""
        return tuple(event.action for event in self.events if isinstance(event, ActionEvent))

    def before(self, event: Event) -> O:
        """The observation before an event."""
        return self.observations[event.time]

    def after(self, event: Event) -> O:
        """The observation after an event; a condition changes nothing."""
        return self.observations[event.time + isinstance(event, ActionEvent)]

    @cached_property
    def segment_times(self) -> dict[int, tuple[int, int]]:
        """For each segment in which something happened: the number of actions executed before it was first
        entered, and when it was last left. Those still open at a limit are left at the end.
        """
        segments = self.program.segments
        times = {0: (0, 0)}
        for event in self.events:
            segment: int | None = event.segment
            after = event.time + isinstance(event, ActionEvent)
            while segment is not None:
                times[segment] = (times.get(segment, (event.time, 0))[0], after)
                segment = segments[segment].parent
        return times


class _LimitReached(Exception):  # noqa: N818 - nothing is wrong
    """Ends a run from any depth."""


class _Run(Generic[O]):
    """The state of a run."""

    __slots__ = ("calls", "events", "limits", "observations", "robot", "time")

    def __init__(self, robot: Robot[O], limits: Limits) -> None:
        self.robot, self.limits = robot, limits
        self.calls = self.time = 0
        self.events: list[Event] = []
        self.observations: list[O] = [robot.observe()]

    def call(self) -> None:
        if self.calls >= self.limits.calls:
            raise _LimitReached
        self.calls += 1


_Step: TypeAlias = Callable[[_Run[Any]], None]
_Test: TypeAlias = Callable[[_Run[Any]], bool]


def run(program: Program, robot: Robot[O], limits: Limits = Limits()) -> Trace[O]:
    """Run a program on a robot until it ends or would need more than the limits allow.

    Raises:
        Exception: only what the robot raises.
    """
    state = _Run(robot, limits)
    try:
        _compiled(program)(state)
        halted = True
    except _LimitReached:
        halted = False
    return Trace(program, tuple(state.events), tuple(state.observations), halted, state.calls)


def covered(program: Program, traces: Iterable[Trace[Any]]) -> bool:
    """Whether every condition of the program was seen both true and false over its traces taken together."""
    seen = {(e.segment, e.value) for trace in traces for e in trace.events if isinstance(e, ConditionEvent)}
    branching = (s.index for s in program.segments if isinstance(s.node, If | IfElse | While))
    return all((index, value) in seen for index in branching for value in (True, False))


def _compiled(program: Program) -> _Step:
    """The program as one function, made once: types and segments are not looked up again in each run."""
    step: _Step | None = program.__dict__.get("_step")
    if step is None:
        step = program.__dict__["_step"] = _compile(program)
    return step


def _compile(program: Program) -> _Step:
    """Inner statements first, without recursion: blocks may nest deeper than Python's stack."""
    whole: list[_Step] = []
    open_statements = [(statement, whole) for statement in reversed(program.body)]
    ordered: list[tuple[Statement, list[_Step], list[list[_Step]]]] = []  # as `Program.segments` counts them
    while open_statements:
        statement, steps = open_statements.pop()
        blocks: list[list[_Step]] = []
        for block in ("orelse", "body"):
            if inner := getattr(statement, block, None):
                blocks.insert(0, [])
                open_statements += [(s, blocks[0]) for s in reversed(inner)]
        ordered.append((statement, steps, blocks))
    for segment in range(len(ordered), 0, -1):
        statement, steps, blocks = ordered[segment - 1]
        steps.insert(0, _statement(statement, segment, [_body(block) for block in blocks]))
    return _body(whole)


def _body(steps: list[_Step]) -> _Step:
    if len(steps) == 1:
        return steps[0]

    def run_steps(state: _Run[Any]) -> None:
        for step in steps:
            step(state)

    return run_steps


def _statement(node: Statement, segment: int, blocks: list[_Step]) -> _Step:
    if isinstance(node, Action):
        return _action(node.name, segment)
    if isinstance(node, Repeat):
        return _repeat(node.times, blocks[0])
    test = _test(node.condition, segment)
    if isinstance(node, While):
        return _while(test, blocks[0])
    return _if(test, blocks[0], blocks[1] if isinstance(node, IfElse) else None)


def _action(name: str, segment: int) -> _Step:
    def act(state: _Run[Any]) -> None:
        limits, time = state.limits, state.time
        if time >= limits.actions or state.calls >= limits.calls:
            raise _LimitReached
        state.calls += 1
        state.robot.act(name)
        state.events.append(ActionEvent(segment, name, time))
        state.observations.append(state.robot.observe())
        state.time = time + 1

    return act


def _test(condition: Condition, segment: int) -> _Test:
    key, negated = unwrapped(condition)

    def test(state: _Run[Any]) -> bool:
        value = bool(state.robot.perceive(key)) is not negated
        state.events.append(ConditionEvent(segment, condition, value, state.time))
        return value

    return test


def unwrapped(condition: Condition) -> tuple[str, bool]:
    """The perception inside any number of ``not``, and whether that number is odd."""
    negated = False
    while isinstance(condition, Not):
        condition, negated = condition.condition, not negated
    assert isinstance(condition, Perception)
    return condition.key, negated


def _if(test: _Test, body: _Step, orelse: _Step | None) -> _Step:
    def branch(state: _Run[Any]) -> None:
        state.call()
        if test(state):
            body(state)
        elif orelse is not None:
            orelse(state)

    return branch


def _while(test: _Test, body: _Step) -> _Step:
    def loop(state: _Run[Any]) -> None:
        state.call()
        state.call()
        while test(state):
            body(state)
            state.call()

    return loop


def _repeat(times: int, body: _Step) -> _Step:
    def repeat(state: _Run[Any]) -> None:
        state.call()
        for _ in range(times):
            body(state)

    return repeat
