"""Verified search on the real engine with the shipped checkpoints: what it finds works, twice the same."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evaps import synthesis
from evaps.dsl import Program, UserError, run
from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.models import SEARCHES, Model, load_model
from evaps.robots.doom import DoomRobot
from evaps.robots.memo import MemoRobot
from evaps.robots.scenes import random_scene
from evaps.synthesis import Budget, News, Solution, Watch, solve
from evaps.synthesis.solution import attempt
from evaps.tasks.task import Example, Task

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def memo() -> Iterator[MemoRobot]:
    robot = MemoRobot(DoomRobot(), PERCEPTION_KEYS, spares=[DoomRobot()])
    yield robot
    robot.close()


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model()


def task_of(text: str, memo: MemoRobot, seed: int = 0) -> Task:
    """Five random scenes, and where a program leads from them."""
    program, rng = Program.parse(f"DEF run m( {text} m)"), np.random.default_rng(seed)
    examples = []
    for _ in range(5):
        scene = random_scene(rng)
        memo.reset(scene)
        trace = run(program, memo)
        assert trace.halted
        examples.append(Example(scene, trace.observations[-1].frame))  # type: ignore[attr-defined]
    memo.forget()
    return Task("random", tuple(examples))


def same(one: Solution, other: Solution) -> bool:
    a, b = ({**s.to_json(), "seconds": 0} for s in (one, other))
    return bool(a == b)


@pytest.mark.parametrize(
    "text",
    [
        "MOVE_FORWARD TURN_LEFT ATTACK",
        "IF c( ISTHERE Demon c) i( MOVE_LEFT i) TURN_RIGHT",
        "IFELSE c( ISTHERE Revenant c) i( MOVE_BACKWARD i) ELSE e( TURN_LEFT TURN_LEFT e)",
    ],
)
def test_it_finds_a_program_that_works(memo: MemoRobot, model: Model, text: str) -> None:
    task = task_of(text, memo)
    solution = solve(model, task, memo, budget=Budget(seconds=60))
    assert solution.solved
    assert attempt(solution.program, task, memo).solved
    assert solution.confidence is not None
    assert 0.0 < solution.confidence <= 1.0
    assert all(candidate.origin == "verified" for candidate in solution.candidates)
    programs = [candidate.program for candidate in solution.candidates]
    assert len(programs) == len(set(programs)) <= 20


def test_what_the_examples_leave_open_is_told(memo: MemoRobot, model: Model) -> None:
    """Both kinds of monsters are there in the same scenes, or neither: which of them is meant?"""
    rng = np.random.default_rng(0)
    program = Program.parse("DEF run m( IF c( ISTHERE Demon c) i( TURN_LEFT i) m)")
    examples: list[Example] = []
    while len(examples) < 5:
        scene = random_scene(rng)
        memo.reset(scene)
        there = memo.perceive("ISTHERE Demon")
        if there == memo.perceive("ISTHERE Revenant") and (there or len(examples) < 3):
            run(program, memo)
            examples.append(Example(scene, memo.observe().frame))
    memo.forget()
    solution = solve(model, Task("open", tuple(examples)), memo, budget=Budget(seconds=60))
    assert solution.solved
    assert solution.doubt is not None
    scene, other = solution.doubt
    ends = []
    for each in (solution.program, other):
        memo.reset(scene)
        ends.append(run(each, memo).observations[-1].digest)  # type: ignore[attr-defined]
    assert ends[0] != ends[1]
    assert solution.confidence is not None
    assert solution.confidence < 1.0
    assert solution.to_json()["doubt"]["program"] == str(other)


def test_twice_the_same(memo: MemoRobot, model: Model) -> None:
    task = task_of("TURN_LEFT IF c( ISTHERE Demon c) i( MOVE_FORWARD i)", memo, seed=3)
    solutions = []
    for _ in range(2):
        memo.forget()
        solutions.append(solve(model, task, memo, budget=Budget(seconds=60)))
    assert same(*solutions)


def mixed_up(memo: MemoRobot) -> Task:
    """The goals of one program, each in the scene of another: nothing solves it."""
    task = task_of("MOVE_FORWARD MOVE_FORWARD ATTACK", memo, seed=4)
    goals = [example.goal for example in task.examples]
    examples = [Example(e.scene, goal) for e, goal in zip(task.examples, goals[1:] + goals[:1], strict=True)]
    return replace(task, examples=tuple(examples))


def test_a_task_that_cannot_be_solved_is_said_to_be_unsolved(memo: MemoRobot, model: Model) -> None:
    solution = solve(model, mixed_up(memo), memo, budget=Budget(actions=150))
    assert not solution.solved
    assert solution.confidence == 0.0
    assert solution.candidates
    assert solution.simulated_actions < 1_500, "it ends soon after the budget is spent"


def test_repairs_are_tried_where_nothing_is_found_for_long(
    memo: MemoRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = load_model(method="verified-with-repairs")
    assert model.repairer is not None
    made, repairs = list[list[list[Program]]](), model.repairer.repairs

    def witnessed(executions: Any, table: Any, beam: int) -> list[list[Program]]:
        made.append([list(programs) for programs in repairs(executions, table, beam)])
        return made[-1]

    monkeypatch.setattr(model.repairer, "repairs", witnessed)
    task = mixed_up(memo)
    solution = solve(model, task, memo, budget=Budget(actions=2_000, seconds=60))
    assert not solution.solved
    assert [len(programs) for programs in made] == [8], "the candidates that pass most, once"
    tried = {program for programs in made[0] for program in programs}
    before = memo.simulated_actions
    for program in list(tried)[:10]:
        attempt(program, task, memo)
    assert memo.simulated_actions == before, "where they lead is known"


def test_all_searches_answer(memo: MemoRobot) -> None:
    assert set(SEARCHES) == set(synthesis.SEARCHES), "whoever has checkpoints has a function"
    task = task_of("MOVE_LEFT", memo, seed=5)
    for name in SEARCHES.keys() - {"sed-search"}:  # whose checkpoint is not shipped
        memo.forget()
        solution = solve(load_model(method=name), task, memo, budget=Budget(actions=800, seconds=60))
        assert solution.solved == attempt(solution.program, task, memo).solved
        if name not in ("blind", "prior"):
            assert solution.solved


def test_a_search_that_is_not_there_is_told() -> None:
    with pytest.raises(UserError, match=r"no method 'lucky'; known are .*verified.*blind"):
        load_model(method="lucky")


@pytest.mark.parametrize("method", ["verified", "evaps"])
def test_a_search_can_be_followed_and_ended(memo: MemoRobot, method: str) -> None:
    task = task_of("IF c( ISTHERE Demon c) i( MOVE_LEFT i) TURN_RIGHT", memo)
    model, heard = load_model(method=method), list[News]()
    memo.forget()
    free = solve(model, task, memo)
    memo.forget()
    assert same(free, solve(model, task, memo, watch=Watch(heard.append))), "who watches changes nothing"
    assert all(len(news.passed) == 5 and news.text for news in heard)
    assert [news.seconds for news in heard] == sorted(news.seconds for news in heard)
    assert sum(heard[-1].passed) == free.candidates[0].final.pairs_passed
    memo.forget()
    ended = solve(model, task, memo, watch=Watch(stopped=lambda: True))
    assert ended.candidates
    assert ended.simulated_actions < free.simulated_actions
