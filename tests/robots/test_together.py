"""Programs that run together: the same traces, for fewer actions."""

import numpy as np
import pytest

from evaps.dsl import Limits, Program, Trace, run
from evaps.dsl.sampler import PERCEPTION_KEYS, sample_program
from evaps.robots.base import Pose, Scene, Thing
from evaps.robots.doom import DoomRobot
from evaps.robots.frames import digest
from evaps.robots.memo import MemoRobot
from evaps.robots.scenes import random_scene
from evaps.robots.together import run_together

SCENE = Scene(Pose(-300, 280, 0), (Thing("Demon", -100, 300),))


@pytest.fixture
def memo(robot: DoomRobot) -> MemoRobot:
    return MemoRobot(robot, PERCEPTION_KEYS)


def straight(*actions: str) -> Program:
    return Program.parse(f"DEF run m( {' '.join(actions)} m)")


def contents(trace: Trace) -> tuple:  # type: ignore[type-arg]
    return trace.program, trace.events, trace.halted, trace.calls, [digest(o) for o in trace.observations]


@pytest.mark.parametrize("limits", [Limits(), Limits(actions=3, calls=9)], ids=["usual", "short"])
def test_traces_are_those_of_a_plain_robot(memo: MemoRobot, robot: DoomRobot, limits: Limits) -> None:
    rng = np.random.default_rng(2)
    programs = [sample_program(rng) for _ in range(15)]
    programs += programs[:3]
    for scene in (random_scene(rng) for _ in range(3)):
        together = run_together(programs, scene, memo, limits)
        memo.leave()
        for program, trace in zip(programs, together, strict=True):
            robot.reset(scene)
            assert contents(run(program, robot, limits)) == contents(trace)
    assert not run_together([], SCENE, memo)


def test_what_leads_on_is_not_walked_again(memo: MemoRobot) -> None:
    """In the order given, each would be walked from the start: 2 + 1 + 3 + 2 actions."""
    ways = [("TURN_LEFT", "ATTACK"), ("ATTACK",), ("TURN_LEFT", "ATTACK", "TURN_LEFT"), ("ATTACK", "ATTACK")]
    traces = run_together([straight(*way) for way in ways], SCENE, memo)
    assert [trace.actions for trace in traces] == ways
    assert memo.simulated_actions == 5


def test_a_second_round_knows_the_first(memo: MemoRobot) -> None:
    way = ("MOVE_LEFT", "TURN_LEFT")
    run_together([straight(*way)], SCENE, memo)
    run_together([straight(*way), straight("MOVE_LEFT")], SCENE, memo)
    assert memo.simulated_actions == 2
