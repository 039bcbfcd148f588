"""Ways: what a policy does is executed, and what is learned from is what was seen."""

import numpy as np
import pytest
import torch

from evaps import load_task
from evaps.dsl import Program
from evaps.dsl.sampler import ACTIONS, PERCEPTION_KEYS
from evaps.models import SHIPPED, load_encoder
from evaps.models.inferred_trace import STOP, InferredTraceConfig, Policy
from evaps.robots.memo import MemoRobot
from evaps.synthesis.features import FeatureTable, embed
from evaps.synthesis.ways import LONGEST, Way, WayTable, follow, gold_ways
from evaps.tasks.task import Task

SHOOT = Program.parse("DEF run m( MOVE_LEFT ATTACK m)")


@pytest.fixture(scope="module")
def task() -> Task:
    return load_task("examples/tasks/sidestep-and-shoot")


@pytest.fixture
def table() -> FeatureTable:
    return FeatureTable(load_encoder(SHIPPED / "small" / "encoder"))


class Scripted(Policy):
    """Does the same on every scene, whatever it sees."""

    def __init__(self, actions: list[str]) -> None:
        super().__init__(InferredTraceConfig())
        self.script = [*map(ACTIONS.index, actions), STOP]
        self.seen: list[torch.Tensor] = []

    def step(self, seen, perceived, goal, last, hidden):  # type: ignore[no-untyped-def]
        time = len(self.seen)
        self.seen.append(seen)
        logits = torch.zeros(len(seen), STOP + 1)
        logits[:, self.script[min(time, len(self.script) - 1)]] = 1
        return logits, hidden


def test_every_predicted_action_is_executed(task: Task, robot: MemoRobot, table: FeatureTable) -> None:
    policy = Scripted(["MOVE_LEFT", "ATTACK"])
    ways = follow(policy, task, robot, table)
    gold = gold_ways(SHOOT, task, robot, table)
    assert ways == gold
    assert all(way.reached for way in ways)
    for pair, example in enumerate(task.examples):
        robot.reset(example.scene)
        for time, action in enumerate(["MOVE_LEFT", "ATTACK", None]):
            (view,) = embed(table.encoder, [robot.observe()])
            torch.testing.assert_close(policy.seen[time][pair], view)
            bits = ways[pair].perceived[time]
            assert [bool(bits >> i & 1) for i in range(6)] == [robot.perceive(p) for p in PERCEPTION_KEYS]
            if action:
                robot.act(action)


def test_a_way_that_misses_its_goal_or_never_ends_counts_for_nothing(
    task: Task, robot: MemoRobot, table: FeatureTable
) -> None:
    missed = follow(Scripted(["MOVE_RIGHT"]), task, robot, table)
    assert not any(way.reached for way in missed)
    endless = follow(Scripted(["TURN_LEFT"] * 100), task, robot, table)
    assert {len(way.actions) for way in endless} == {LONGEST + 1}
    there = gold_ways(SHOOT, task, robot, table)
    ways = WayTable.of([missed, there], table.table).batch([0, 1], torch.device("cpu"))
    assert ways.real.sum((1, 2)).tolist() == [0, 15]
    torch.testing.assert_close(ways.seen[1, 0, 0], table.table[there[0].rows[0]])


def test_batches_are_cut_to_their_longest_way() -> None:
    short = [Way([0, 1], [0, 3], [2, STOP], 1, True)] * 5
    long = [Way([0, 1, 2, 3], [0, 0, 0, 32], [0, 1, 2, STOP], 3, True)] * 5
    table = WayTable.of([short, long], torch.arange(8.0).reshape(4, 2))
    ways = table.batch([0], torch.device("cpu"))
    assert ways.seen.shape == (1, 5, 2, 2)
    assert ways.perceived[0, 0].tolist() == [[0] * 6, [1, 1, 0, 0, 0, 0]]
    ways = table.batch([1, 0], torch.device("cpu"))
    assert ways.actions[1, 0].tolist() == [2, STOP, STOP, STOP]
    assert ways.real[1, 0].tolist() == [True, True, False, False]
    assert np.array_equal(ways.goal[:, 0].numpy(), [[6, 7], [2, 3]])
