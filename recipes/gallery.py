"""The gallery: test tasks picked at random, what each method answers there, and what became of it.

    python -m recipes.gallery   # results/small/gallery.html from the committed rows; a minute after the data

The tasks are drawn by seed, not by success. An answer is a method's first candidate, the one that counts as
top-1 in the tables; its program is taken from the rows and run again.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from evaps.dsl import Program
from evaps.metrics import Results, Row
from evaps.models import SEARCHES
from evaps.report import SEARCHED
from evaps.report.names import name_of
from evaps.report.tables import TABLE_1
from evaps.robots.memo import MemoRobot
from evaps.synthesis import memo_of, team_of_robots
from evaps.synthesis.solution import Candidate, attempt_all
from evaps.tasks.dataset import Dataset, gold_task
from evaps.tasks.task import EXAMPLES, Example, GoldTask, Task
from evaps.viewer.gallery import Answer, Exhibit, write_gallery
from recipes.paper import Plan, make_data

LEAD = (
    "{} test tasks, drawn by a seed ({}) and not by success, and each method's first answer. They saw five "
    "examples: a scene, and the view that the robot should end with. An answer is right if it does what the "
    "hidden program does in all five scenes, and in a sixth one that was kept back. No method has seen that "
    "program; the sentences that say where an answer goes wrong come from comparing the two runs.",
    "A tick: right. A number: wrong, and so many of the six views are the ones that were meant.",
)


@dataclass(frozen=True)
class Gallery:
    """What is shown."""

    tasks: int = 20
    """How many test tasks."""
    seed: int = 0
    """Of the draw."""
    rows: Path = Path("results/small/methods")
    """Folder of the rows, METHOD-0.parquet and searches/verified.parquet."""
    methods: tuple[str, ...] = (*TABLE_1, "verified")
    """Who answers."""
    data: Path = Path("data/small")
    """The data set that the rows are of."""
    out: Path = Path("results/small/gallery.html")
    """The page."""


def first_answers(gallery: Gallery) -> dict[str, dict[int, Row]]:
    """Of each method the row of its first candidate, by the index of the task."""
    found = {}
    for method in gallery.methods:
        path = f"{SEARCHED}/{method}.parquet" if method in SEARCHES else f"{method}-0.parquet"
        run = Results.read(gallery.rows / path).first(method)
        found[method] = {task: run.rows[task][0] for task in run.tasks}
    return found


def drawn(dataset: Dataset, judged: set[int], gallery: Gallery) -> Iterator[GoldTask]:
    """Test tasks at random of those that all were judged on, with their answers."""
    test = [p for p in dataset.split("test") if dataset.rows[p]["index"] in judged]
    chosen = np.random.default_rng(gallery.seed).choice(test, min(gallery.tasks, len(test)), replace=False)
    for position, frames in dataset.frames(sorted(chosen.tolist())):
        yield gold_task(dataset.rows[position], frames)


def exhibit(gold: GoldTask, rows: dict[str, Row], robot: MemoRobot) -> Exhibit:
    """Run the hidden program, and each method's answer with what it was before each repair.

    Raises:
        ValueError: a row says something else of a program than its run.
    """
    scenes = Task(gold.name, tuple(Example(o.scene, o.goal) for o in gold.outcomes))
    (meant,) = attempt_all([gold.program], scenes, robot)
    answers = []
    for method, row in rows.items():
        attempts = attempt_all([Program.parse(a["program"]) for a in row["attempts"]], scenes, robot)
        if sum(attempts[-1].passed[:EXAMPLES]) != row["pairs_passed"]:
            raise ValueError(f"{gold.name}: the rows of {method} are of other scenes than these")
        candidate = Candidate(tuple(attempts), row["rank"], method)
        answers.append(Answer(name_of(method), candidate, row["generalization_state"]))
    return Exhibit(gold.name, tuple(o.goal for o in gold.outcomes), meant, tuple(answers))


def main(gallery: Gallery) -> None:
    """Run the answers, and write the page."""
    if gallery.data == Plan().data:
        make_data(Plan())
    answers = first_answers(gallery)
    judged = set.intersection(*(set(rows) for rows in answers.values()))
    robots = team_of_robots()
    shown = []
    for gold in drawn(Dataset(gallery.data), judged, gallery):
        robot = memo_of(robots)
        index = int(gold.name.removeprefix("task-"))
        shown.append(exhibit(gold, {method: rows[index] for method, rows in answers.items()}, robot))
        robot.leave()
    write_gallery(gallery.out, shown, [text.format(len(shown), gallery.seed) for text in LEAD])
    for each in robots:
        each.close()
    print(gallery.out)


if __name__ == "__main__":
    main(tyro.cli(Gallery, description=__doc__))
