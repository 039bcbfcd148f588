import ast
from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_programs import programs

from evaps.dsl import ActionEvent, ConditionEvent, Limits, Not, Perception, Program, covered, run

PERCEPTION = Perception("ISTHERE", "Demon")


class Toy:
    """Observes the number of actions so far, and answers from a list, over and over."""

    def __init__(self, answers=(True,), patience=10**9):
        self.answers, self.patience = answers, patience
        self.asked, self.log = 0, []

    def act(self, action):
        self.note(action)

    def perceive(self, perception):
        self.note(perception)
        self.asked += 1
        return self.answers[(self.asked - 1) % len(self.answers)]

    def observe(self):
        return sum(" " not in entry for entry in self.log)

    def note(self, entry):
        if len(self.log) >= self.patience:
            raise TimeoutError
        self.log.append(entry)


def body(text):
    return Program.parse(f"DEF run m( {text} m)")


def test_a_straight_line():
    trace = run(body("MOVE_LEFT ATTACK"), Toy())
    assert trace.events == (ActionEvent(1, "MOVE_LEFT", 0), ActionEvent(2, "ATTACK", 1))
    assert trace.actions == ("MOVE_LEFT", "ATTACK")
    assert trace.observations == (0, 1, 2)
    assert trace.segment_times == {0: (0, 2), 1: (0, 1), 2: (1, 2)}
    assert (trace.halted, trace.calls) == (True, 2)


def test_a_while_loop():
    program = body("TURN_LEFT WHILE c( not c( ISTHERE Demon c) c) w( ATTACK w) MOVE_LEFT")
    trace = run(program, Toy([False, False, True]))
    condition = Not(PERCEPTION)
    assert trace.events == (
        ActionEvent(1, "TURN_LEFT", 0),
        ConditionEvent(2, condition, True, 1),
        ActionEvent(3, "ATTACK", 1),
        ConditionEvent(2, condition, True, 2),
        ActionEvent(3, "ATTACK", 2),
        ConditionEvent(2, condition, False, 3),
        ActionEvent(4, "MOVE_LEFT", 3),
    )
    assert trace.segment_times == {0: (0, 4), 1: (0, 1), 2: (1, 3), 3: (1, 3), 4: (3, 4)}
    assert trace.calls == 4 + 1 + 3  # actions, the statement, three conditions
    assert [(trace.before(e), trace.after(e)) for e in trace.events if isinstance(e, ActionEvent)] == [
        (0, 1),
        (1, 2),
        (2, 3),
        (3, 4),
    ]


def test_a_branch_not_taken_has_no_times():
    program = body("IFELSE c( ISTHERE Demon c) i( ATTACK i) ELSE e( MOVE_LEFT e)")
    yes, no = run(program, Toy([True])), run(program, Toy([False]))
    assert yes.segment_times == {0: (0, 1), 1: (0, 1), 2: (0, 1)}
    assert no.segment_times == {0: (0, 1), 1: (0, 1), 3: (0, 1)}
    assert run(body("IF c( ISTHERE Demon c) i( ATTACK i)"), Toy([False])).segment_times == {
        0: (0, 0),
        1: (0, 0),
    }
    assert (yes.calls, no.actions) == (2, ("MOVE_LEFT",))


def test_nested_loops_are_entered_once_and_left_last():
    program = body(
        "REPEAT R=2 r( MOVE_LEFT REPEAT R=3 r( ATTACK r) WHILE c( ISTHERE Demon c) w( TURN_LEFT w) r)"
    )
    trace = run(program, Toy([True, False]))
    inner = ("MOVE_LEFT", "ATTACK", "ATTACK", "ATTACK", "TURN_LEFT")
    assert trace.actions == inner * 2
    assert trace.segment_times == {
        0: (0, 10),
        1: (0, 10),
        2: (0, 6),
        3: (1, 9),
        4: (1, 9),
        5: (4, 10),
        6: (4, 10),
    }
    assert trace.calls == 1 + 2 * (1 + (1 + 3) + (1 + 2 + 1))


def test_the_action_limit():
    program = body("REPEAT R=4 r( REPEAT R=5 r( ATTACK r) r)")
    assert run(program, Toy()).halted
    trace = run(body("REPEAT R=4 r( REPEAT R=5 r( ATTACK r) r) MOVE_LEFT"), Toy())
    assert (trace.halted, trace.actions, len(trace.observations)) == (False, ("ATTACK",) * 20, 21)
    assert trace.segment_times == {0: (0, 20), 1: (0, 20), 2: (0, 20), 3: (0, 20)}


def test_segments_open_at_a_limit_are_left_at_the_end():
    program = body("WHILE c( ISTHERE Demon c) w( MOVE_LEFT IF c( ISTHERE Demon c) i( ATTACK i) w)")
    trace = run(program, Toy(), Limits(actions=3))
    assert trace.actions == ("MOVE_LEFT", "ATTACK", "MOVE_LEFT")
    assert trace.segment_times == {0: (0, 3), 1: (0, 3), 2: (0, 3), 3: (1, 3), 4: (1, 2)}


@pytest.mark.parametrize(
    ("text", "answers", "calls"),
    [
        ("ATTACK MOVE_LEFT", [True], 2),
        ("IF c( ISTHERE Demon c) i( ATTACK i)", [True], 2),
        ("IF c( ISTHERE Demon c) i( ATTACK i)", [False], 1),
        ("REPEAT R=3 r( ATTACK r)", [True], 4),
        ("WHILE c( ISTHERE Demon c) w( ATTACK w)", [False], 2),
        ("WHILE c( ISTHERE Demon c) w( ATTACK w)", [True, True, False], 6),
    ],
)
def test_calls_are_counted_and_limited(text, answers, calls):
    exact = run(body(text), Toy(answers), Limits(calls=calls))
    assert (exact.halted, exact.calls) == (True, calls)
    short = run(body(text), Toy(answers), Limits(calls=calls - 1))
    assert (short.halted, short.calls) == (False, calls - 1)
    assert short.events == exact.events[: len(short.events)]


def test_a_loop_that_does_nothing_stops():
    trace = run(body("WHILE c( ISTHERE Demon c) w( IF c( not c( ISTHERE Demon c) c) i( ATTACK i) w)"), Toy())
    assert (trace.halted, trace.actions, trace.calls) == (False, (), 100)


def test_no_call_no_event():
    trace = run(body("ATTACK"), Toy(), Limits(calls=0))
    assert (trace.events, trace.observations, trace.segment_times) == ((), (0,), {0: (0, 0)})


def test_deep_programs_run():
    depth = 90
    program = body("IF c( ISTHERE Demon c) i( " * depth + "ATTACK" + " i)" * depth)
    assert run(program, Toy()).actions == ("ATTACK",)


def test_faults_of_the_robot_pass_through():
    with pytest.raises(TimeoutError):
        run(body("ATTACK ATTACK"), Toy(patience=1))


def test_coverage_takes_traces_together():
    program = body("IF c( ISTHERE Demon c) i( WHILE c( ISTHERE Demon c) w( ATTACK w) i)")
    both, outer = run(program, Toy([True, True, False])), run(program, Toy([False]))
    assert covered(program, [both, outer])
    assert not covered(program, [both])
    assert not covered(program, [outer])
    assert not covered(program, [])
    assert covered(body("REPEAT R=2 r( ATTACK r)"), [])


def executed(program, robot):
    """What happens when Python itself runs the Python form."""
    names = {
        node.func.id for node in ast.walk(ast.parse(program.to_python())) if isinstance(node, ast.Call)
    } - {"range"}
    scope = {thing: thing for thing in ("Demon", "HellKnight", "Revenant")}
    scope |= {name: partial(robot.act, name.upper()) for name in names}
    scope["is_there"] = lambda thing: robot.perceive(f"ISTHERE {thing}")
    scope["in_target"] = lambda thing: robot.perceive(f"INTARGET {thing}")
    exec(program.to_python(), scope)
    scope["run"]()


@given(programs, st.lists(st.booleans(), min_size=1, max_size=12))
def test_python_runs_the_python_form_in_the_same_way(program, answers):
    theirs, ours = Toy(answers, patience=60), Toy(answers, patience=60)
    trace = None
    try:
        executed(program, theirs)
    except TimeoutError:
        with pytest.raises(TimeoutError):
            run(program, ours, Limits(10**6, 10**6))
    else:
        trace = run(program, ours, Limits(10**6, 10**6))
        assert trace.halted
        assert list(trace.actions) == [entry for entry in theirs.log if " " not in entry]
    assert ours.log == theirs.log


@given(programs, st.lists(st.booleans(), min_size=1, max_size=12), st.integers(0, 20), st.integers(0, 100))
def test_a_limited_run_is_the_beginning_of_a_longer_one(program, answers, actions, calls):
    short = run(program, Toy(answers), Limits(actions, calls))
    long = run(program, Toy(answers), Limits(40, 200))
    assert short.events == long.events[: len(short.events)]
    assert len(short.actions) <= actions
    assert short.calls <= calls
    assert short.observations == tuple(range(len(short.actions) + 1))
    if short.halted:
        assert short.events == long.events
    else:
        assert len(short.actions) == actions or short.calls == calls
    for event in short.events:
        before, after = short.segment_times[event.segment]
        assert before <= event.time <= after <= len(short.actions)
