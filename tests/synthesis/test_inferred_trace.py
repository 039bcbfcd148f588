"""Inferred Trace as a whole: it learns 32 tasks by heart, from the ways that its own policy goes."""

from collections.abc import Callable, Iterator
from itertools import count, islice

import pytest
import torch
from torch import Tensor, nn

from evaps.bench.tasks import specification
from evaps.dsl.sampler import SamplerConfig
from evaps.models import SHIPPED, load_encoder
from evaps.models.beam import beam_search
from evaps.models.inferred_trace import InferredTrace, InferredTraceConfig
from evaps.robots.memo import MemoRobot
from evaps.synthesis.features import FeatureTable
from evaps.synthesis.ways import WayTable, follow, gold_ways
from evaps.tasks.generate import Draft, generate_task
from evaps.train.lessons import Lessons

TASKS = range(32)
CPU = torch.device("cpu")

pytestmark = pytest.mark.slow


def short_tasks(robot: MemoRobot) -> Iterator[Draft]:
    """Tasks of few actions: a way is as long as the longest one of a batch."""
    drafts = (generate_task(5, index, robot, SamplerConfig()) for index in count())
    return (draft for draft in drafts if draft.steps <= 6)


def learn(net: nn.Module, loss: Callable[[], Tensor], below: float) -> None:
    optimizer = torch.optim.Adam(net.parameters(), lr=2e-3)
    for _ in range(300):
        value = loss()
        if value.item() < below:
            return
        optimizer.zero_grad()
        value.backward()
        nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimizer.step()


def test_it_learns_32_tasks_by_heart_from_what_its_policy_does(robot: MemoRobot) -> None:
    torch.manual_seed(0)
    drafts = list(islice(short_tasks(robot), len(TASKS)))
    tasks = [specification(draft) for draft in drafts]
    net = InferredTrace(InferredTraceConfig(hidden=128, pair=128, dropout=0.0))
    table = FeatureTable(load_encoder(SHIPPED / "small" / "encoder"))

    gold = [gold_ways(draft.program, task, robot, table) for draft, task in zip(drafts, tasks, strict=True)]
    taught = WayTable.of(gold, table.table).batch(TASKS, CPU)
    learn(net.policy, lambda: net.policy.loss(taught)[0], below=0.01)
    own = [follow(net.policy, task, robot, table) for task in tasks]
    ways = WayTable.of(own, table.table)
    assert ways.reached.mean() >= 0.95

    gone = ways.batch(TASKS, CPU)
    targets = Lessons.of([draft.program.token_ids.tolist() for draft in drafts]).batch(TASKS)
    learn(net, lambda: net.loss(gone, *targets), below=0.05)
    beams = beam_search(net.eval(), gone, 1)
    right = [beam[0].program == draft.program for beam, draft in zip(beams, drafts, strict=True)]
    assert sum(right) >= 0.95 * len(TASKS)
