"""The repair loop on the real engine, with a repairer that follows a script."""

from collections.abc import Iterator, Sequence
from typing import ClassVar

import numpy as np
import pytest
import torch
from torch import Tensor

from evaps.dsl import Program, run
from evaps.models import Model
from evaps.models.base import Execution, Repairer
from evaps.models.beam import Proposal
from evaps.models.encoder import Encoder, EncoderConfig
from evaps.models.lgrl import LGRL
from evaps.robots.frames import digest
from evaps.robots.memo import MemoRobot
from evaps.robots.scenes import random_scene
from evaps.synthesis.best_first import synthesize_best_first
from evaps.synthesis.features import FeatureTable
from evaps.synthesis.repair import _until_best, repair_all
from evaps.synthesis.solution import Candidate, attempt, best_first
from evaps.tasks.task import Example, Task

GOLD = Program.parse("DEF run m( MOVE_FORWARD IF c( ISTHERE Demon c) i( TURN_LEFT i) MOVE_LEFT m)")
CLOSE = Program.parse("DEF run m( MOVE_FORWARD TURN_LEFT MOVE_LEFT m)")
WRONG = Program.parse("DEF run m( ATTACK REPEAT R=2 r( MOVE_LEFT r) m)")


class Script(Repairer):
    """Answers with the programs of a list, one after the other."""

    name: ClassVar[str] = "script"

    def __init__(self, programs: Sequence[Program | None]) -> None:
        super().__init__()
        self.programs = list(programs)
        self.seen: list[list[Execution]] = []
        self.tried: list[list[set[Program]]] = []

    def repair(
        self, executions: Sequence[Execution], table: Tensor, tried: Sequence[set[Program]]
    ) -> list[Program | None]:
        self.seen.append(list(executions))
        self.tried.append(list(tried))
        return [self.programs.pop(0) for _ in executions]

    def repairs(self, executions: Sequence[Execution], table: Tensor, beam: int) -> list[Iterator[Program]]:
        self.seen.append(list(executions))
        return [iter([p for p in self.programs if p is not None][:beam]) for _ in executions]

    def batch(self, executions: object, targets: object, device: object) -> None:
        return None

    def batch_loss(self, batch: None, table: object) -> Tensor:
        return torch.zeros(())


@pytest.fixture(scope="module")
def task(robot: MemoRobot) -> Task:
    rng, examples = np.random.default_rng(5), []
    for scene in [random_scene(rng) for _ in range(5)]:
        robot.reset(scene)
        examples.append(Example(scene, run(GOLD, robot).observations[-1]))
    return Task("scripted", tuple(examples))


@pytest.fixture
def table() -> FeatureTable:
    torch.manual_seed(0)
    return FeatureTable(Encoder(EncoderConfig()).eval())


def test_it_repairs_until_all_pairs_pass(task: Task, robot: MemoRobot, table: FeatureTable) -> None:
    chain = [attempt(WRONG, task, robot)]
    assert not chain[0].solved
    script = Script([CLOSE, GOLD, WRONG])
    repair_all(script, [chain], task, table, robot)
    assert [a.program for a in chain] == [WRONG, CLOSE, GOLD]
    assert chain[-1].passed == (True,) * 5
    assert script.tried == [[{WRONG}], [{WRONG, CLOSE}]]


def test_it_stops_after_the_rounds_and_when_nothing_new_comes(
    task: Task, robot: MemoRobot, table: FeatureTable
) -> None:
    right, stuck, slow = ([attempt(p, task, robot)] for p in (GOLD, WRONG, CLOSE))
    script = Script([None, WRONG, CLOSE])
    repair_all(script, [right, stuck, slow], task, table, robot, rounds=2)
    assert [len(c) for c in (right, stuck, slow)] == [1, 1, 3]
    assert [len(executions) for executions in script.seen] == [2, 1]


def test_executions_say_what_was_seen_around_each_segment(
    task: Task, robot: MemoRobot, table: FeatureTable
) -> None:
    tried = attempt(GOLD, task, robot)
    (execution,) = table.executions([tried], task)
    assert execution.before.shape == (5, len(GOLD.segments))
    for pair, trace in enumerate(tried.traces):
        rows = table.rows(trace.observations)
        assert execution.before[pair, 0] == execution.first[pair] == rows[0]
        assert execution.after[pair, 0] == execution.final[pair] == rows[-1]
        executed = set(trace.segment_times)
        assert {int(s) for s in np.flatnonzero(execution.before[pair] >= 0)} == executed
        turned = next(s.index for s in GOLD.segments if "TURN_LEFT" in GOLD.tokens[s.start : s.start + 1])
        assert (turned in executed) == ("TURN_LEFT" in trace.actions)
    goals = [example.goal for example in task.examples]
    views = {digest(o) for o in (*goals, *(o for t in tried.traces for o in t.observations))}
    assert table.table.shape == (len(views), 256)


def test_best_first_is_by_pairs_passed_then_by_rank(task: Task, robot: MemoRobot) -> None:
    attempts = [attempt(p, task, robot) for p in (WRONG, CLOSE, GOLD, GOLD)]
    candidates = [Candidate((a,), rank, "test") for rank, a in enumerate(attempts)]
    ordered = best_first(candidates)
    assert ordered[0].program == GOLD
    assert len(ordered) == 3
    passed = [c.final.pairs_passed for c in ordered]
    assert passed == sorted(passed, reverse=True)


def test_an_answer_goes_no_further_than_its_best_attempt(task: Task, robot: MemoRobot) -> None:
    close, wrong, gold = (attempt(program, task, robot) for program in (CLOSE, WRONG, GOLD))
    assert wrong.pairs_passed < close.pairs_passed < gold.pairs_passed
    assert list(_until_best([close, wrong])) == [close]
    assert list(_until_best([wrong, close, close, wrong])) == [wrong, close]
    assert list(_until_best([wrong, gold])) == [wrong, gold]


def test_best_first_goes_on_from_what_passes_most(
    task: Task, robot: MemoRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    proposals = [Proposal(WRONG, -1.0), Proposal(CLOSE, -2.0)]
    monkeypatch.setattr("evaps.synthesis.best_first.propose", lambda *_: proposals)
    repairer = Script([WRONG, GOLD])
    encoder = Encoder(EncoderConfig(channels=(4, 4, 4, 4, 4), feature=8)).eval()
    solution = synthesize_best_first(Model(encoder, LGRL(), repairer), task, robot)
    assert solution.solved
    assert solution.program == GOLD
    assert [a.program for a in solution.candidates[0].attempts] == [CLOSE, GOLD]
    assert [e.program for (e,) in repairer.seen] == [CLOSE]
    assert {c.program for c in solution.candidates} == {GOLD, CLOSE, WRONG}


def test_best_first_gives_up(task: Task, robot: MemoRobot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evaps.synthesis.best_first.propose", lambda *_: [Proposal(WRONG, -1.0)])
    repairer = Script([CLOSE])
    encoder = Encoder(EncoderConfig(channels=(4, 4, 4, 4, 4), feature=8)).eval()
    solution = synthesize_best_first(Model(encoder, LGRL(), repairer), task, robot, calls=5)
    assert not solution.solved
    assert len(repairer.seen) == 2, "nothing new comes of either"
    assert solution.program == CLOSE
