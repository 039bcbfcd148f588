"""Attempts on the real engine, and the order of candidates."""

import json
from collections.abc import Iterator

import pytest

from evaps.dsl import Program, run
from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.robots.base import Pose, Scene, Thing
from evaps.robots.doom import DoomRobot
from evaps.robots.frames import frame_match
from evaps.robots.memo import MemoRobot
from evaps.synthesis.solution import Attempt, Candidate, Solution, attempt, best_first
from evaps.tasks.task import Example, Task

GOLD = Program.parse("DEF run m( IF c( ISTHERE Demon c) i( TURN_LEFT i) MOVE_FORWARD m)")


@pytest.fixture(scope="module")
def robot() -> Iterator[MemoRobot]:
    robot = MemoRobot(DoomRobot(), PERCEPTION_KEYS)
    yield robot
    robot.close()


@pytest.fixture(scope="module")
def task(robot: MemoRobot) -> Task:
    """Two of the five scenes show a Demon."""
    examples = []
    for i in range(5):
        things = (Thing("Demon", 0, 300),) if i < 2 else (Thing("Revenant", 0, 300),)
        scene = Scene(Pose(-300, 260 + 10 * i, 0), things)
        robot.reset(scene)
        examples.append(Example(scene, run(GOLD, robot).observations[-1]))
    return Task("turn", tuple(examples))


def tried(text: str, task: Task, robot: MemoRobot) -> Attempt:
    return attempt(Program.parse(f"DEF run m( {text} m)"), task, robot)


def test_the_gold_program_passes_all(robot: MemoRobot, task: Task) -> None:
    found = attempt(GOLD, task, robot)
    assert (found.passed, found.pairs_passed, found.solved) == ((True,) * 5, 5, True)
    assert [trace.actions for trace in found.traces] == [("TURN_LEFT", "MOVE_FORWARD")] * 2 + [
        ("MOVE_FORWARD",)
    ] * 3


def test_each_example_is_judged_by_its_last_view(robot: MemoRobot, task: Task) -> None:
    assert tried("MOVE_FORWARD", task, robot).passed == (False, False, True, True, True)
    assert tried("TURN_LEFT MOVE_FORWARD", task, robot).passed == (True, True, False, False, False)
    assert not tried("ATTACK MOVE_FORWARD ATTACK", task, robot).solved


def test_what_does_not_halt_passes_nothing(robot: MemoRobot, task: Task) -> None:
    """Its last view equals the goal: 20 turns to and fro, and only then what would need one more action."""
    back = "REPEAT R=5 r( TURN_LEFT TURN_RIGHT TURN_LEFT TURN_RIGHT r)"
    scenes = [example.scene for example in task.examples]
    goals = []
    for scene in scenes:
        robot.reset(scene)
        goals.append(robot.observe())
    still = Task("still", tuple(map(Example, scenes, goals)))
    assert tried(back, still, robot).solved
    endless = tried(f"{back} MOVE_FORWARD", still, robot)
    assert all(frame_match(t.observations[-1], g) for t, g in zip(endless.traces, goals, strict=True))
    assert (endless.passed, endless.pairs_passed) == ((False,) * 5, 0)


def test_attempts_do_not_disturb_one_another(robot: MemoRobot, task: Task) -> None:
    before = tried("MOVE_FORWARD", task, robot)
    simulated = robot.simulated_actions
    tried("MOVE_FORWARD", task, robot)
    assert robot.simulated_actions == simulated, "known"
    robot.forget()
    assert tried("MOVE_FORWARD", task, robot).passed == before.passed


class TestOrder:
    def candidate(self, action: str, passed: int, rank: int) -> Candidate:
        program = Program.parse(f"DEF run m( {action} m)")
        return Candidate((Attempt(program, (), (True,) * passed + (False,) * (5 - passed)),), rank, "LGRL")

    def test_by_pairs_passed_and_then_by_rank(self) -> None:
        a, b = self.candidate("ATTACK", 3, 0), self.candidate("MOVE_LEFT", 5, 1)
        c, d = self.candidate("MOVE_RIGHT", 3, 2), self.candidate("TURN_LEFT", 0, 3)
        assert best_first([d, c, b, a]) == (b, a, c, d)
        assert best_first([]) == ()

    def test_equal_programs_come_once(self) -> None:
        first, again = self.candidate("ATTACK", 3, 1), self.candidate("ATTACK", 3, 4)
        other = self.candidate("MOVE_LEFT", 3, 2)
        assert best_first([again, other, first]) == (first, other)

    def test_the_last_attempt_counts(self) -> None:
        worse, better = self.candidate("ATTACK", 1, 0), self.candidate("MOVE_LEFT", 4, 0)
        repaired = Candidate(worse.attempts + better.attempts, 7, "LGRL + EVAPS x1")
        between = self.candidate("MOVE_RIGHT", 2, 1)
        assert repaired.program == better.program
        assert best_first([between, repaired]) == (repaired, between)

    def test_a_solution_as_json(self) -> None:
        candidates = (self.candidate("MOVE_LEFT", 5, 1), self.candidate("ATTACK", 3, 0))
        solution = Solution("turn", candidates, 12, 0.12345)
        assert solution.solved
        assert str(solution.program) == "DEF run m( MOVE_LEFT m)"
        assert json.loads(json.dumps(solution.to_json())) == {
            "task": "turn",
            "candidates": [
                {"program": "DEF run m( MOVE_LEFT m)", "pairs_passed": 5, "origin": "LGRL"},
                {"program": "DEF run m( ATTACK m)", "pairs_passed": 3, "origin": "LGRL"},
            ],
            "solved": True,
            "simulated_actions": 12,
            "seconds": 0.123,
        }
        assert not Solution("turn", candidates[1:], 0, 0.0).solved
