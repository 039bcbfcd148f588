"""How often Inferred Trace's policy reaches the goals, and what methods solve where it does.

    python -m recipes.ways   # results/small/ways.json; five minutes after `recipes.paper`

The policy goes from each of the five scenes towards its goal, as the method lets it. Of the tasks in which it
reaches none, one ... all of the five it is counted for how many a method has a candidate that generalizes.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import torch

from evaps.metrics import TOP, Results
from evaps.models import load_model
from evaps.models.inferred_trace import InferredTrace
from evaps.synthesis import memo_of, team_of_robots
from evaps.synthesis.features import FeatureTable
from evaps.synthesis.ways import follow
from evaps.tasks.dataset import Dataset, gold_task
from evaps.tasks.progress import track
from evaps.tasks.task import EXAMPLES
from recipes.command import start
from recipes.paper import Plan, make_data
from recipes.result import write_result

OUT = Path("results/small/ways.json")
TASKS = 300
COMPARED = ("inferred-trace", "lgrl", "evaps")


def goals_reached(plan: Plan) -> dict[int, int]:
    """For each of the first test tasks, by its index, how many of its goals the policy reaches."""
    dataset = Dataset(plan.data)
    tasks = dataset.split("test")[:TASKS]
    model = load_model(plan.runs(0), "inferred-trace")
    assert isinstance(model.synthesizer, InferredTrace)
    memo = memo_of(team_of_robots())
    reached = {}
    for position, frames in track(dataset.frames(tasks), len(tasks), "tasks"):
        row = dataset.rows[position]
        task = gold_task(row, frames).task
        memo.forget()
        ways = follow(model.synthesizer.policy, task, memo, FeatureTable(model.encoder, 0.0))
        reached[row["index"]] = sum(way.reached for way in ways)
    memo.close()
    return reached


def main() -> None:
    """Count, and write what was found."""
    torch.set_num_threads(1)
    plan = Plan()
    make_data(plan)
    reached = goals_reached(plan)
    rows = Results.read(plan.results / "methods")
    groups = []
    for number in range(EXAMPLES + 1):
        tasks = [task for task, goals in reached.items() if goals == number]
        solved = rows.of_tasks(tasks)
        shares = {m: round(float(solved.top(m, "generalization_state", max(TOP))[0]), 1) for m in COMPARED}
        groups.append({"goals reached": number, "tasks": len(tasks), f"generalization@{max(TOP)}": shares})
    share = round(100 * float(np.mean(list(reached.values()))) / EXAMPLES, 1)
    found = {"goals reached of all": share, "tasks": len(reached), "by goals reached": groups}
    write_result(OUT, found)
    print(json.dumps(found))


if __name__ == "__main__":
    start(main)
