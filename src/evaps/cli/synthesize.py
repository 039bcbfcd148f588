"""``evaps synthesize``: programs for task folders. ``evaps demo``: the same for the shipped ones."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tyro.conf import Positional

from evaps.cli.command import Command
from evaps.cli.inputs import File, check_least, check_writable, writing
from evaps.dsl import UserError

if TYPE_CHECKING:
    from evaps.models import Model
    from evaps.tasks.task import Task
    from evaps.viewer import TaskReport

SHIPPED_TASKS = Path("examples/tasks")


@dataclass(frozen=True)
class Synthesize(Command):
    """Write programs for tasks: five scenes, and what the robot should see at the end.

    The synthesizer's candidates are run on the five scenes and, with --method evaps, repaired with what the
    robot saw. Candidates are shown best first; a pair is passed if the last view equals the goal, every byte.
    """

    tasks: Positional[tuple[Path, ...]]
    """Task folders."""
    method: str = "evaps"
    """evaps repairs the candidates of lgrl; lgrl stands for these candidates alone."""
    model: str = "small"
    """A shipped set of checkpoints, or a folder of them from `evaps train`."""
    top_k: int = 20
    """How many candidates are run and repaired."""
    rounds: int = 5
    """How often a candidate is repaired at most."""
    json: bool = False
    """Print one JSON object a task, a line each."""
    report: File | None = None
    """Write a page that shows what happened: goals, repairs, what the robot saw."""

    def run(self) -> None:
        """Synthesize and show."""
        check_least(top_k=(self.top_k, 1), rounds=(self.rounds, 0))
        if not self.tasks:
            raise UserError("name at least one task folder, such as examples/tasks/*")
        from evaps.models import load_model
        from evaps.tasks.task import load_task

        loaded = [load_task(folder) for folder in self.tasks]  # all of them, before the first is worked on
        model = load_model(self.model, self.method)
        if self.report is not None:
            check_writable(self.report)
        reports = []
        for report in solve(loaded, model, self.top_k, self.rounds):
            show(report, self.json)
            reports.append(report)
        if self.report is not None:
            save_page(self.report, reports, quiet=self.json)


@dataclass(frozen=True)
class Demo(Command):
    """Synthesize programs for the tasks in examples/tasks, check them on the engine, and write a page."""

    out: File = Path("out/demo.html")
    """The page."""

    def run(self) -> None:
        """Solve the shipped tasks."""
        from evaps.models import load_model
        from evaps.tasks.task import load_task

        folders = sorted(path.parent for path in SHIPPED_TASKS.glob("*/task.json"))
        if not folders:
            raise UserError(f"there are no tasks in {SHIPPED_TASKS}; run this in the root of a checkout")
        check_writable(self.out)
        reports = []
        for report in solve([load_task(folder) for folder in folders], load_model(), 20, 5):
            show(report, False)
            reports.append(report)
        solved = sum(report.solution.solved for report in reports)
        print(f"{solved} of {len(reports)} tasks solved: all five goals reached on the engine, byte for byte")
        save_page(self.out, reports, quiet=False)


def solve(tasks: Sequence[Task], model: Model, top_k: int, rounds: int) -> Iterator[TaskReport]:
    """Synthesize for each task on one robot.

    On one thread: a second one gains a tenth, and where another program needs its core, torch's threads wait
    for each other and a task takes ten times as long.
    """
    import torch

    torch.set_num_threads(1)
    from evaps.dsl.sampler import PERCEPTION_KEYS
    from evaps.robots.doom import DoomRobot
    from evaps.robots.memo import MemoRobot
    from evaps.synthesis import synthesize_with
    from evaps.viewer import TaskReport

    robot = DoomRobot()
    try:
        for task in tasks:
            memo = MemoRobot(robot, PERCEPTION_KEYS)  # lives as long as its views: the page shows them
            yield TaskReport(task, synthesize_with(model, task, memo, top_k, rounds))
            memo.leave()
    finally:
        robot.close()


def show(report: TaskReport, as_json: bool) -> None:
    """Print one solution."""
    if as_json:
        print(json.dumps(report.solution.to_json()), flush=True)
        return
    from rich.console import Console

    from evaps.viewer import show_solution

    show_solution(Console(highlight=False), report)


def save_page(path: Path, reports: Sequence[TaskReport], quiet: bool) -> None:
    """Write the report page and say where it is."""
    from evaps.viewer import write_page

    with writing(path):
        write_page(path, reports)
    if not quiet:
        print(f"page: {path.resolve()}")
