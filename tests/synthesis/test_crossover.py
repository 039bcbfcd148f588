"""Crossovers on the real engine: they pass what both parents pass, and cost nothing."""

from collections.abc import Iterator

import numpy as np
import pytest

from evaps.dsl import Program, run
from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.robots.doom import DoomRobot
from evaps.robots.memo import MemoRobot
from evaps.robots.scenes import random_scene
from evaps.synthesis.crossover import crossovers
from evaps.synthesis.solution import Attempt, attempt_all
from evaps.tasks.task import Example, Task


@pytest.fixture(scope="module")
def memo() -> Iterator[MemoRobot]:
    robot = MemoRobot(DoomRobot(), PERCEPTION_KEYS)
    yield robot
    robot.close()


def task_of(gold: Program, memo: MemoRobot) -> Task:
    """Scenes in some of which a demon is seen after a turn, and what the program leads to there."""
    rng, examples, seen = np.random.default_rng(0), list[Example](), list[bool]()
    while len(examples) < 5:
        scene = random_scene(rng)
        memo.reset(scene)
        memo.act("TURN_LEFT")
        demon = memo.perceive("ISTHERE Demon")
        if seen.count(demon) < 3:
            seen.append(demon)
            memo.reset(scene)
            run(gold, memo)
            examples.append(Example(scene, memo.observe().frame))
    return Task("demons", tuple(examples))


def tried(task: Task, memo: MemoRobot, *texts: str) -> list[Attempt]:
    return attempt_all([Program.parse(f"DEF run m( {text} m)") for text in texts], task, memo)


def crossed(task: Task, memo: MemoRobot, *texts: str) -> list[Program]:
    return crossovers(tried(task, memo, *texts), [example.scene for example in task.examples], memo)


@pytest.mark.parametrize(
    ("gold", "parents"),
    [
        (
            "TURN_LEFT IFELSE c( ISTHERE Demon c) i( MOVE_BACKWARD i) ELSE e( TURN_LEFT e)",
            ("TURN_LEFT MOVE_BACKWARD", "TURN_LEFT TURN_LEFT"),
        ),
        (
            "TURN_LEFT IF c( ISTHERE Demon c) i( TURN_LEFT TURN_LEFT i)",
            ("TURN_LEFT", "TURN_LEFT TURN_LEFT TURN_LEFT"),
        ),
        (
            "TURN_LEFT IF c( not c( ISTHERE Demon c) c) i( TURN_LEFT TURN_LEFT i)",
            ("TURN_LEFT", "TURN_LEFT TURN_LEFT TURN_LEFT"),
        ),
    ],
)
def test_what_two_pass_together_their_crossover_passes(
    memo: MemoRobot, gold: str, parents: tuple[str, ...]
) -> None:
    program = Program.parse(f"DEF run m( {gold} m)")
    task = task_of(program, memo)
    attempts = tried(task, memo, *parents)
    assert not any(attempt.solved for attempt in attempts)
    before = memo.simulated_actions
    found = crossed(task, memo, *parents)
    assert program in found
    assert all(attempt.solved for attempt in attempt_all(found, task, memo))
    assert memo.simulated_actions == before


def test_who_passes_nothing_or_everything_or_the_same_is_not_crossed(memo: MemoRobot) -> None:
    task = task_of(Program.parse("DEF run m( TURN_LEFT IF c( ISTHERE Demon c) i( TURN_LEFT i) m)"), memo)
    assert crossed(task, memo, "TURN_LEFT", "ATTACK ATTACK") == []
    assert crossed(task, memo, "TURN_LEFT", "TURN_LEFT TURN_RIGHT TURN_LEFT") == []
    assert crossed(task, memo, "TURN_LEFT IF c( ISTHERE Demon c) i( TURN_LEFT i)", "TURN_LEFT") == []
