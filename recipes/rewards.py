"""What rewards add to the very LGRL that they start from, seed by seed.

    python -m recipes.rewards   # results/small/methods/rewards; after `recipes.paper`, with its checkpoints

Table 1 has both, too, but not always of one training: where `lgrl-rl` was trained later than the rows of LGRL
were made, its LGRL was trained again.
"""

from __future__ import annotations

import shutil

import tyro

from evaps.models import METHODS
from recipes.command import start
from recipes.paper import Plan, judge, make_checkpoint, make_data, make_rows, rows_path, with_what_is_needed

REWARDED = "lgrl-rl"


def main(plan: Plan) -> None:
    """The rows of both for each seed, in a folder of their own; what is there is not made again."""
    before = METHODS[REWARDED].start
    assert before is not None
    folder = plan.results / "methods" / "rewards"
    make_data(plan)
    for seed in plan.seeds:
        for method in with_what_is_needed((REWARDED,)):
            make_checkpoint(plan, seed, method)
        judge(plan, plan.runs(seed), (before,), folder / f"{before}-{seed}.parquet")
        make_rows(plan, seed, REWARDED)
        shutil.copy(rows_path(plan, seed, REWARDED), folder)


if __name__ == "__main__":
    start(lambda: main(tyro.cli(Plan, description=__doc__)))
