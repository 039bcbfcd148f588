"""The gallery: test tasks picked at random, what each method answers there, and what became of it.

    python -m recipes.gallery   # results/small/gallery.html from the committed rows; a minute after the data

The tasks are drawn by seed, not by success. An answer is a method's first candidate, the one that counts as
top-1 in the tables; its program is taken from the rows and run again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from evaps.cli.inputs import check_least
from evaps.dsl import Program, UserError
from evaps.evaluate import match
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
from recipes.command import start
from recipes.paper import Plan, make_data

LEAD = (
    "{} test tasks, drawn by a seed ({}) and not by success. Each method saw five examples: a scene, and the "
    "view that the robot should end with. Here is the first program that it handed out, as repair left it: "
    "right if in these five scenes, and in a sixth one that was kept back, it ends as the hidden program, "
    "which no method has seen. Of a wrong one is told where its run parts from the hidden program's; that "
    "need not be its only fault.",
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


def first_answers(gallery: Gallery) -> dict[str, dict[str, Row]]:
    """Of each method the row of its first candidate, by the name of the task."""
    found = {}
    for method in gallery.methods:
        path = f"{SEARCHED}/{method}.parquet" if method in SEARCHES else f"{method}-0.parquet"
        run = Results.read(gallery.rows / path).first(method)
        found[method] = {f"task-{task}": run.rows[task][0] for task in run.tasks}
    return found


def drawn(dataset: Dataset, judged: set[str], gallery: Gallery) -> Iterator[GoldTask]:
    """Test tasks at random of those that all were judged on, with their answers."""
    test = [p for p in dataset.split("test") if f"task-{dataset.rows[p]['index']}" in judged]
    chosen = np.random.default_rng(gallery.seed).choice(test, min(gallery.tasks, len(test)), replace=False)
    for position, frames in dataset.frames(sorted(chosen.tolist())):
        yield gold_task(dataset.rows[position], frames)


def exhibit(gold: GoldTask, rows: Mapping[str, Row], robot: MemoRobot) -> Exhibit:
    """Run the hidden program, and each method's answer with what it was before each repair.

    Args:
        gold: the task with its answer.
        rows: of each method's first candidate.
        robot: runs them.

    Raises:
        UserError: a row says something else of a program than its run.
    """
    scenes = Task(gold.name, tuple(Example(o.scene, o.goal) for o in gold.outcomes))
    (meant,) = attempt_all([gold.program], scenes, robot)
    answers = []
    for method, row in rows.items():
        attempts = attempt_all([Program.parse(a["program"]) for a in row["attempts"]], scenes, robot)
        right = match(attempts[-1].program, gold, robot).generalization_state
        passed = sum(attempts[-1].passed[:EXAMPLES])
        if (passed, right) != (row["pairs_passed"], row["generalization_state"]):
            raise UserError(f"the rows of {method} are of another {gold.name} than the one of this data set")
        answers.append(Answer(name_of(method), Candidate(tuple(attempts), row["rank"], method), right))
    return Exhibit(gold.name, tuple(o.goal for o in gold.outcomes), meant, tuple(answers))


def main(gallery: Gallery) -> None:
    """Run the answers, and write the page."""
    check_least(tasks=(gallery.tasks, 1))
    if gallery.data == Plan().data:  # the recipe's own is made if it is not there
        make_data(Plan())
    answers = first_answers(gallery)
    judged = set.intersection(*(set(rows) for rows in answers.values()))
    shown = []
    with ExitStack() as stack:
        robots = [stack.enter_context(closing(robot)) for robot in team_of_robots()]
        for gold in drawn(Dataset(gallery.data), judged, gallery):
            robot = memo_of(robots)
            shown.append(exhibit(gold, {method: rows[gold.name] for method, rows in answers.items()}, robot))
            robot.leave()
    write_gallery(gallery.out, shown, [text.format(len(shown), gallery.seed) for text in LEAD])
    print(gallery.out)


if __name__ == "__main__":
    start(lambda: main(tyro.cli(Gallery, description=__doc__)))
