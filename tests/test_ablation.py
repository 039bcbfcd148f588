"""The ablation's mistakes with what was seen elsewhere."""

import numpy as np

from evaps.dsl import Program
from evaps.models.base import Execution
from evaps.synthesis.mistakes import Mistakes
from recipes.ablation import looking_elsewhere


def test_each_example_has_the_last_ones_observations_and_its_own_goal() -> None:
    program = Program.parse("DEF run m( MOVE_LEFT m)")
    segments = np.arange(10).reshape(5, 2)
    ends = np.arange(5)
    seen = Execution(program, segments, segments + 10, ends, ends + 20, ends + 40)
    found = looking_elsewhere(Mistakes([7], [seen], [program], [1], np.zeros((50, 4), np.float16)))
    moved = found.executions[0]
    assert moved.before[:, 0].tolist() == [8, 0, 2, 4, 6]
    assert moved.after[:, 1].tolist() == [19, 11, 13, 15, 17]
    assert moved.final.tolist() == [24, 20, 21, 22, 23]
    assert moved.first.tolist() == ends.tolist()
    assert moved.goal.tolist() == (ends + 40).tolist()
