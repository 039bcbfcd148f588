"""What happened on the way to an answer, in the pieces that are shown of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import groupby, pairwise
from typing import TYPE_CHECKING

from evaps.dsl import ActionEvent, ConditionEvent, Program, Trace
from evaps.dsl.alignment import Edit, align
from evaps.robots.frames import Observation
from evaps.tasks.task import Task

if TYPE_CHECKING:  # else a page would load torch
    from evaps.synthesis.solution import Attempt, Candidate, Solution


@dataclass(frozen=True)
class TaskReport:
    """A task and the answer to it: what a report shows.

    Attributes:
        task: the specification.
        solution: the answer.
        notes: what else is known of it, by a word or two that stands beside it.
    """

    task: Task
    solution: Solution
    notes: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Change:
    """A stretch of tokens that an edit keeps, or that it deletes and puts others in the place of."""

    kept: str
    deleted: str
    inserted: str


@dataclass(frozen=True)
class Round:
    """A round of repair.

    Attributes:
        number: from 1.
        before: the attempt that was repaired.
        after: what came of it.
        changes: how the token form of the one becomes that of the other.
    """

    number: int
    before: Attempt
    after: Attempt
    changes: tuple[Change, ...]


def rounds(candidate: Candidate) -> Iterator[Round]:
    """The rounds of repair that a candidate went through; none if it was handed out as proposed."""
    for number, (before, after) in enumerate(pairwise(candidate.attempts), 1):
        edits = align(before.program.tokens, after.program.tokens)
        yield Round(number, before, after, tuple(_changes(edits)))


def _changes(edits: Iterable[Edit]) -> Iterator[Change]:
    for kept, group in groupby(edits, lambda edit: edit.kind == "keep"):
        part = list(group)
        old = " ".join(edit.old for edit in part if edit.old is not None)
        new = " ".join(edit.new for edit in part if edit.new is not None)
        yield Change(old, "", "") if kept else Change("", old, new)


@dataclass(frozen=True)
class Check:
    """An evaluated condition: the line that it stands in, such as ``if is_there(Demon)``, and its value."""

    text: str
    value: bool


@dataclass(frozen=True)
class Step:
    """A moment of a run.

    Attributes:
        view: what the robot saw.
        checks: the conditions evaluated at this view, in order.
        action: what it did then, such as ``turn_left()``; None at the end of the run.
    """

    view: Observation
    checks: tuple[Check, ...]
    action: str | None


def steps(trace: Trace[Observation]) -> list[Step]:
    """A run as a filmstrip: the first view and one more after each action."""
    lines = _first_lines(trace.program)
    checks: list[list[Check]] = [[] for _ in trace.observations]
    actions: list[str | None] = [None for _ in trace.observations]
    for event in trace.events:
        if isinstance(event, ActionEvent):
            actions[event.time] = lines[event.segment]
        else:
            checks[event.time].append(Check(lines[event.segment], event.value))
    frames = zip(trace.observations, checks, actions, strict=True)
    return [Step(view, tuple(asked), action) for view, asked, action in frames]


def _first_lines(program: Program) -> dict[int, str]:
    """For each segment its first line in the Python form, without indentation and colon."""
    return {segment: text.strip().removesuffix(":") for segment, text in reversed(program.python_lines)}


@dataclass(frozen=True)
class LineView:
    """A line of a program and what the robot saw around the segment that begins there.

    Attributes:
        text: the line, in the Python form.
        starts: whether a segment begins here; an ``else:`` goes on with one that began before.
        before: the view when the segment was first entered; None if it never was.
        after: the view when it was last left; None if it never was.
        changed: whether an action lies between the two.
        note: how often it ran, or the values of its condition.
    """

    text: str
    starts: bool
    before: Observation | None
    after: Observation | None
    changed: bool
    note: str


def line_views(trace: Trace[Observation]) -> list[LineView]:
    """What the robot saw around each line's segment in a run."""
    views, seen = [], set[int]()
    for segment, text in trace.program.python_lines:
        starts = segment not in seen
        seen.add(segment)
        times = trace.segment_times.get(segment) if starts else None
        before, after = (trace.observations[t] for t in times) if times else (None, None)
        changed = times is not None and times[0] != times[1]
        note = _note(trace, segment) if starts else ""
        views.append(LineView(text, starts, before, after, changed, note))
    return views


def _note(trace: Trace[Observation], segment: int) -> str:
    events = [event for event in trace.events if event.segment == segment]
    values = [event.value for event in events if isinstance(event, ConditionEvent)]
    if not values:
        return f"ran {len(events)} times" if len(events) > 1 else ""
    runs = [(str(value).lower(), len(list(same))) for value, same in groupby(values)]
    return ", ".join(value if times == 1 else f"{value} ×{times}" for value, times in runs)


def telling_example(attempt: Attempt) -> int:
    """The example that tells most about an attempt: of those that it fails, where most of it is executed."""
    numbers = range(len(attempt.traces))
    failed = [i for i in numbers if not attempt.passed[i]] or list(numbers)
    return max(failed, key=lambda i: (len(attempt.traces[i].segment_times), -i))
