"""The best programs that look at nothing of the task: a floor that every method has to beat.

    python -m recipes.fixed   # results/small/fixed.json; an hour or two after the data

All programs of one, two and three actions run on the first test tasks. The best one is chosen by the very
tasks that it is judged on, and so are the best five and twenty (greedily, by how many tasks more they solve).
"""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path

import numpy as np

from evaps.dsl import Program
from evaps.dsl.sampler import ACTIONS
from evaps.files import write_atomically
from evaps.metrics import TOP
from evaps.tasks.dataset import Dataset
from evaps.train.judge import Judge
from recipes.paper import DATA_SEED, Plan, make_data

OUT = Path("results/small/fixed.json")
TASKS = 300
LONGEST = 3


def main() -> None:
    """Judge all of them, and write what the best do."""
    plan = Plan()
    make_data(plan)
    dataset = Dataset(plan.data)
    judge = Judge(dataset)
    bodies = [body for n in range(1, LONGEST + 1) for body in product(ACTIONS, repeat=n)]
    programs = [Program.parse(f"DEF run m( {' '.join(body)} m)") for body in bodies]
    right = np.stack([judge.matches(p, programs).all(1) for p in dataset.split("test")[:TASKS]])
    chosen: list[int] = []
    solved = np.zeros(len(right), np.bool_)
    shares = []
    for _ in range(max(TOP)):
        gains = (right & ~solved[:, None]).sum(0)
        best = int(gains.argmax())
        if gains[best]:
            chosen.append(best)
            solved |= right[:, best]
        shares.append(round(100 * float(solved.mean()), 2))
    found = {
        "programs": [str(programs[i]) for i in chosen],
        "generalization": {str(k): shares[k - 1] for k in TOP},
        "tasks": len(right),
        "of": len(programs),
        "dataset_seed": DATA_SEED,
    }
    write_atomically(OUT, (json.dumps(found, indent=1) + "\n").encode())
    print(found["generalization"])


if __name__ == "__main__":
    main()
