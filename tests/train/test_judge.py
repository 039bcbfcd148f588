"""The judge gives the same verdicts as running the gold programs does."""

from pathlib import Path

import pytest

from evaps.dsl import Program
from evaps.robots.workers import Workers
from evaps.tasks.build import generate
from evaps.tasks.dataset import Dataset
from evaps.train.judge import Judge

pytestmark = pytest.mark.slow


def test_gold_programs_match_and_others_do_where_they_end_alike(tmp_path: Path) -> None:
    generate(tmp_path, 4, 3, Workers(0), part=4, frames=False)
    dataset = Dataset(tmp_path)
    judge = Judge(dataset)
    golds = [Program.parse(text) for text in dataset.rows.column("program")]
    nothing = Program.parse("DEF run m( TURN_LEFT TURN_RIGHT m)")
    for position, gold in enumerate(golds):
        first, other, last = judge.passed(position, [gold, nothing, gold])
        assert (first, last) == (6, 6)
        assert other < 6
        assert judge.generalize(position, [nothing, gold]).tolist() == [False, True]
    assert judge.share_right(range(4), golds) == 1.0
    assert judge.share_right(range(4), [golds[0], None, nothing, golds[3]]) == 0.5
    assert judge.share_right([0, 1], [golds[1], golds[1]]) == 0.5
