"""The best programs that look at nothing of the task: a floor that every method has to beat.

    python -m recipes.fixed   # results/small/fixed.json; some minutes after the data

All programs of one and two actions run on the first test tasks. The best one is chosen by the very
tasks that it is judged on, and so are the best five and twenty (greedily, by how many tasks more they solve).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np

from evaps.dsl import Program
from evaps.dsl.sampler import ACTIONS
from evaps.files import write_atomically
from evaps.metrics import TOP
from evaps.tasks.dataset import Dataset
from evaps.tasks.progress import track
from evaps.train.judge import Judge
from recipes.command import start
from recipes.paper import DATA_SEED, Plan, make_data
from recipes.result import write_result

OUT = Path("results/small/fixed.json")
TASKS = 1_000
LONGEST = 2


def judged(programs: Sequence[Program], dataset: Dataset) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    """For each task and program whether it is right in all six scenes; goes on where it was interrupted."""
    part = OUT.with_suffix(".part")
    solving = [line.split(",") for line in part.read_text().splitlines()] if part.exists() else []
    judge = Judge(dataset)
    tasks = dataset.split("test")[:TASKS]
    for position in track(tasks[len(solving) :], len(tasks), "tasks", len(solving)):
        right = judge.generalize(position, programs)
        solving.append([str(program) for program, solves in zip(programs, right, strict=True) if solves])
        write_atomically(part, "".join(",".join(texts) + "\n" for texts in solving).encode())
    return np.array([[str(program) in texts for program in programs] for texts in solving])


def main() -> None:
    """Judge all of them, and write what the best do."""
    plan = Plan()
    make_data(plan)
    dataset = Dataset(plan.data)
    bodies = [body for n in range(1, LONGEST + 1) for body in product(ACTIONS, repeat=n)]
    programs = [Program.parse(f"DEF run m( {' '.join(body)} m)") for body in bodies]
    right = judged(programs, dataset)
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
    write_result(OUT, found)
    OUT.with_suffix(".part").unlink()
    print(found["generalization"])


if __name__ == "__main__":
    start(main)
