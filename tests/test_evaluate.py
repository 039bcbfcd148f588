"""Evaluation: what a match is, and that statistics do what they say."""

from pathlib import Path

import numpy as np
import pytest

from evaps.dsl import Program, run
from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.evaluate import SCHEMA, match
from evaps.metrics import answers, paired_difference, summarize
from evaps.robots.base import Pose, Scene, Thing
from evaps.robots.doom import DoomRobot
from evaps.robots.memo import MemoRobot
from evaps.tasks.dataset import write_table
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


def rows(method: str, ranks_that_match: list[int | None]) -> list[dict[str, object]]:
    blank = dict(seed=0, scale="test", commit="", weights="", evaluated_by="", machine="", dataset_seed=0)
    blank |= dict(steps=2, program="", pairs_passed=0, rounds=0)
    cost = dict(simulated_actions=10, seconds=1.0, semantic_frame=False, generalization_frame=False)
    return [
        {
            **blank,
            **cost,
            "method": method,
            "task": task,
            "rank": rank,
            **dict.fromkeys(("exact", "semantic_state", "generalization_state"), rank == right),
        }
        for task, right in enumerate(ranks_that_match)
        for rank in range(20)
    ]


def test_top_k_counts_a_task_once_any_of_its_first_k_matches(tmp_path: Path) -> None:
    path = tmp_path / "rows.parquet"
    write_table(path, rows("lgrl", [0, 4, 5, 19, None]) + rows("evaps", [0, 0, 0, 0, None]), SCHEMA)
    lgrl, evaps = summarize(path)
    assert [lgrl[f"exact@{k}"] for k in (1, 5, 20)] == [20, 40, 80]
    assert [evaps[f"exact@{k}"] for k in (1, 5, 20)] == [80, 80, 80]
    assert lgrl["tasks"] == 5


def test_the_answer_is_the_first_of_those_that_pass_most_pairs(tmp_path: Path) -> None:
    made = rows("lgrl", [3, 3, 0])
    passed = {(0, 3): 5, (0, 7): 5, (1, 2): 4, (1, 5): 4}  # task and rank
    for row in made:
        row["pairs_passed"] = passed.get((row["task"], row["rank"]), 1)
    write_table(tmp_path / "rows.parquet", made, SCHEMA)
    assert answers(tmp_path / "rows.parquet", "lgrl") == {0: True, 1: False, 2: True}
    assert summarize(tmp_path / "rows.parquet")[0]["answer"] == pytest.approx(200 / 3)


def test_the_bootstrap_interval_covers_zero_exactly_when_it_should(tmp_path: Path) -> None:
    path = tmp_path / "rows.parquet"
    rng = np.random.default_rng(0)
    a = [0 if x < 0.5 else None for x in rng.random(300)]
    b = [0 if x < 0.5 else None for x in rng.random(300)]
    better = [0 if x == 0 or rng.random() < 0.3 else None for x in a]
    write_table(path, rows("a", a) + rows("b", b) + rows("better", better), SCHEMA)
    mean, low, high = paired_difference(path, "better", "a", "exact", 1, draws=2000)
    assert 0 < low < mean < high < 30
    mean, low, high = paired_difference(path, "b", "a", "exact", 1, draws=2000)
    assert low < 0 < high
