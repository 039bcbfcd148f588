"""Evaluation: what a match is, and that statistics do what they say."""

from typing import Any

import numpy as np
import pytest
from rows import RIGHT, WRONG, repaired, results_of, rows

from evaps.bootstrap import MARGIN, Interval, bootstrap, bootstraps
from evaps.dsl import Program, UserError, run
from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.evaluate import match
from evaps.robots.base import Pose, Scene, Thing
from evaps.robots.doom import DoomRobot
from evaps.robots.memo import MemoRobot
from evaps.tasks.task import GoldTask, Outcome

GOLD = Program.parse("DEF run m( MOVE_FORWARD MOVE_LEFT IF c( INTARGET Demon c) i( TURN_LEFT i) m)")
SAME = Program.parse("DEF run m( MOVE_LEFT MOVE_FORWARD IF c( INTARGET Demon c) i( TURN_LEFT i) m)")


@pytest.fixture(scope="module")
def judged() -> dict[str, object]:
    robot = MemoRobot(DoomRobot(), PERCEPTION_KEYS)
    # Nothing stands in the way, so the two moves commute; the condition holds in the test scene alone.
    empty = [Scene(Pose(-300, y, 0)) for y in (200, 220, 240, 260, 280)]
    ahead = [Scene(Pose(-300, 240, 0), (Thing("Demon", 60, y),)) for y in range(200, 400, 10)]
    outcomes: list[Outcome] = []
    for scene in (*empty, *ahead):
        robot.reset(scene)
        trace = run(GOLD, robot)
        if len(outcomes) < 6 and ("TURN_LEFT" in trace.actions) == bool(scene.things):
            outcomes.append(Outcome(scene, robot.observe(), robot.state()))
    gold = GoldTask("task-0", GOLD, tuple(outcomes), 3)
    short = Program.parse("DEF run m( MOVE_LEFT MOVE_FORWARD m)")
    endless = Program.parse("DEF run m( MOVE_LEFT MOVE_FORWARD REPEAT R=6 r( REPEAT R=6 r( ATTACK r) r) m)")
    wrong = Program.parse("DEF run m( MOVE_LEFT m)")
    programs = {"gold": GOLD, "same": SAME, "short": short, "endless": endless, "wrong": wrong}
    found = {name: match(program, gold, robot) for name, program in programs.items()}
    robot.close()
    return found


@pytest.mark.parametrize(
    ("name", "exact", "semantic", "generalization"),
    [
        ("gold", True, True, True),
        ("same", False, True, True),
        ("short", False, True, False),
        ("endless", False, False, False),
        ("wrong", False, False, False),
    ],
)
def test_the_three_metrics(
    judged: dict[str, object], name: str, exact: bool, semantic: bool, generalization: bool
) -> None:
    found = judged[name]
    assert found.exact == exact
    assert found.semantic_state == found.semantic_frame == semantic
    assert found.generalization_state == found.generalization_frame == generalization


def test_top_k_counts_a_task_once_any_of_its_first_k_matches() -> None:
    results = results_of(rows("lgrl", [0, 4, 5, 19, None]), rows("evaps", [0, 0, 0, 0, None]))
    assert [float(results.top("lgrl", "exact", k)[0]) for k in (1, 5, 20)] == [20, 40, 80]
    assert [float(results.top("evaps", "exact", k)[0]) for k in (1, 5, 20)] == [80, 80, 80]
    assert len(results.first("lgrl").tasks) == 5


def test_the_answer_is_the_first_of_those_that_pass_most_pairs() -> None:
    made = rows("lgrl", [3, 3, 0])
    passed = {(0, 3): 5, (0, 7): 5, (1, 2): 4, (1, 5): 4}  # task and rank
    for row in made:
        row["pairs_passed"] = passed.get((row["task"], row["rank"]), 1)
    assert results_of(made).first("lgrl").answered().tolist() == [True, False, True]


def test_an_answer_is_the_best_attempt_and_not_the_last() -> None:
    made = repaired("evaps", [[False, True, False], [False, False]])
    for row in made:
        row["pairs_passed"] = row["attempts"][-1]["pairs_passed"]
        row["generalization_state"] = row["attempts"][-1]["generalization_state"]
    run = results_of(made).first("evaps")
    assert run.answered().tolist() == [True, False]
    assert [row["program"] for row in run.answers()] == [RIGHT, WRONG]
    assert run.matches("generalization_state", 1).tolist() == [False, False]
    assert [row["rounds"] for row in run.answers()] == [None, None], "those of the last attempt"


@pytest.mark.parametrize(
    ("groups", "what"),
    [
        ([rows("lgrl", [0]), rows("lgrl", [None])], "task 0 has two rows of lgrl, seed 0, rank 0"),
        (
            [rows("lgrl", [0]), rows("lgrl", [0, 0], seed=1)],
            "seed 1, were judged on different tasks",
        ),
        (
            [rows("lgrl", [0]), [row | {"trained_on": 50} for row in rows("lgrl", [0], seed=1)]],
            "lgrl, seed 0 and seed 1, differ in trained_on: 100, 50",
        ),
        (
            [rows("blind", [0]), [row | {"budget": 10_000} for row in rows("blind", [0], seed=1)]],
            "blind, seed 0 and seed 1, differ in budget: 10000, 3500",
        ),
        (
            [rows("lgrl", [0]), [row | {"noise": 0.25} for row in rows("evaps", [0])]],
            "more than one noise: 0, 0.25",
        ),
        (
            [[row | {"split": split} for row in rows(split, [0])] for split in ("test", "train")],
            "more than one split: test, train",
        ),
    ],
)
def test_rows_that_do_not_belong_together_are_refused(groups: list[list[dict[str, Any]]], what: str) -> None:
    with pytest.raises(UserError, match=what):
        results_of(*groups)


def test_the_bootstrap_interval_covers_zero_exactly_when_it_should() -> None:
    rng = np.random.default_rng(0)
    a = [0 if x < 0.5 else None for x in rng.random(300)]
    b = [0 if x < 0.5 else None for x in rng.random(300)]
    better = [0 if x == 0 or rng.random() < 0.3 else None for x in a]
    results = results_of(rows("a", a), rows("b", b), rows("better", better))
    found = results.difference("better", "a", "exact", 1, draws=2000)
    assert 0 < found.low < found.mean < found.high < 30
    assert found.certain
    found = results.difference("b", "a", "exact", 1, draws=2000)
    assert found.low < 0 < found.high
    assert not found.certain


def test_what_is_certain_would_be_so_with_other_draws() -> None:
    gains = np.random.default_rng(3).choice([-100.0, 0.0, 100.0], (3, 1000), p=[0.08, 0.82, 0.1])
    lows = [bootstrap(gains, seed).low for seed in range(5)]
    assert lows == pytest.approx([np.median(lows)] * 5, abs=MARGIN + 1e-3)
    assert not Interval(2.0, 0.05, 4.0).certain
    assert Interval(-2.0, -4.0, -0.2).certain


def test_seeds_are_kept_apart_and_averaged() -> None:
    results = results_of(rows("a", [0, None], 0), rows("a", [0, 0], 1), rows("b", [None, None], 0))
    assert results.top("a", "exact", 1).tolist() == [50, 100]
    assert results.difference("a", "b", "exact", 1, draws=100).mean == 50, "on the seed that both have"
    with pytest.raises(ValueError, match="not judged on the same tasks"):
        results_of(rows("a", [0]), rows("b", [0, 0])).difference("a", "b", "exact", 1)


def test_the_interval_is_as_wide_as_theory_says() -> None:
    values = np.where(np.random.default_rng(1).random((1, 1000)) < 0.3, 100.0, 0.0)
    found = bootstrap(values)
    error = 1.96 * values.std() / 1000**0.5
    assert (found.high - found.low) / 2 == pytest.approx(error, rel=0.1)


def test_two_seeds_that_differ_make_the_interval_as_wide_as_they_are_apart() -> None:
    found = bootstrap(np.stack([np.zeros(1000), np.full(1000, 100.0)]), draws=1000)
    assert found == (50, 0, 100)


def test_few_seeds_vary_by_as_much_as_the_mean_of_seeds_does() -> None:
    """The variance of a mean of n is a mean of n's unbiased variance; without it three look too alike."""
    seeds = np.array([0.0, 30.0, 90.0])
    found = bootstrap(seeds[:, None] + np.random.default_rng(0).normal(0, 1, (3, 2000)))
    drawn = sorted((a + b) / 2 for a in seeds for b in seeds)  # of three seeds two
    assert found.mean == pytest.approx(40, abs=0.2)
    assert found.low == pytest.approx(drawn[0], abs=0.5)
    assert found.high == pytest.approx(drawn[-1], abs=0.5)
    assert np.var(drawn) == pytest.approx(np.var(seeds, ddof=1) / 3)


def test_items_are_judged_on_the_same_draws() -> None:
    values = np.random.default_rng(2).normal(0, 1, (2, 300))
    one, shifted = bootstraps(np.stack([values, values + 5]), draws=500)
    assert np.array(shifted) == pytest.approx(np.array(one) + 5, abs=1e-5)
    assert one == pytest.approx(bootstrap(values, draws=500), abs=1e-5)
