"""``evaps synthesize``: programs for task folders. ``evaps demo``: the same for the shipped ones."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from evaps.cli.command import Command
from evaps.cli.inputs import File, MaybeFile, check_least, check_writable, writing
from evaps.domain import CHOSEN, DOOM
from evaps.dsl import UserError

if TYPE_CHECKING:
    from evaps.models import Model
    from evaps.synthesis import Budget, News
    from evaps.tasks.task import Task
    from evaps.viewer import TaskReport

RANDOM_TASKS = 6
PACKAGE = Path(__file__).parents[1]
SHIPPED_TASKS = tuple(
    root / "examples" / "tasks" for root in (PACKAGE, PACKAGE.parents[1])
)  # wheel, checkout


@dataclass(frozen=True)
class Synthesize(Command):
    """Write programs for tasks: five scenes, and what the robot should see at the end.

    Verified synthesis looks for ways to the goals on the engine, and for the shortest program that explains
    them. Candidates are shown best first; a pair is passed if the last view equals the goal, every byte.
    """

    tasks: Annotated[Positional[tuple[Path, ...]], arg(help_behavior_hint="(at least one)")]
    """Task folders."""
    method: str = "verified"
    """verified; evaps, the paper's loop on lgrl's candidates; lgrl, these alone; or, say, lgrl+naive."""
    model: str = CHOSEN.model
    """A shipped set of checkpoints, a folder of them from `evaps train`, or hub:OWNER/NAME."""
    top_k: int = 20
    """How many candidates come back at most; methods other than verified run, and repair, so many."""
    rounds: int = 5
    """How often a candidate is repaired at most; not for verified."""
    actions: int = CHOSEN.budget
    """Actions that a search may simulate; what it has found is then explained and compared with some more."""
    seconds: float = 8.0
    """How long it may search; it may take a little longer."""
    seed: int = 0
    """Of what is random in a search: the further scenes on which candidates are compared."""
    explain: bool = False
    """Show a scene on which another program that passes all examples does otherwise, if one was found."""
    json: bool = False
    """Print one JSON object a task, a line each."""
    report: MaybeFile = None
    """Write a page that shows what happened: goals, repairs, what the robot saw."""

    def run(self) -> None:
        """Synthesize and show."""
        check_least(
            top_k=(self.top_k, 1), rounds=(self.rounds, 0), actions=(self.actions, 1), seed=(self.seed, 0)
        )
        if not self.seconds > 0:  # nor is nan
            raise UserError(f"--seconds must be more than 0, not {self.seconds}")
        if not self.tasks:
            raise UserError("name at least one task folder, such as examples/tasks/*")
        from evaps.models import load_model
        from evaps.tasks.task import load_task

        loaded = [load_task(folder) for folder in self.tasks]  # all of them, before the first is worked on
        model = load_model(self.model, self.method)
        if self.report is not None:
            check_writable(self.report)
        from evaps.synthesis import Budget

        reports = []
        budget = Budget(self.actions, self.seconds)
        for report in solve_all(loaded, model, self.top_k, self.rounds, budget, self.seed):
            show(report, self.json)
            if self.explain and not self.json:
                show_doubt(report)
            reports.append(report)
        if self.report is not None:
            save_page(self.report, reports, quiet=self.json)


@dataclass(frozen=True)
class Demo(Command):
    """Synthesize programs for the tasks in examples/tasks, check them on the engine, and write a page.

    Where no tasks are shipped, as for Karel, for six random ones.
    """

    out: File = Path("out/demo.html")
    """The page."""
    json: bool = False
    """Print one JSON object a task, a line each."""

    def run(self) -> None:
        """Solve the shipped tasks."""
        from evaps.models import load_model
        from evaps.tasks.task import load_task

        folders = shipped_tasks()
        if not folders and CHOSEN is DOOM:
            raise UserError(f"there are no tasks in {SHIPPED_TASKS[0]}; install evaps again")
        check_writable(self.out)
        tasks = [load_task(folder) for folder in folders] or random_tasks(RANDOM_TASKS)
        reports = []
        for report in solve_all(tasks, load_model()):
            show(report, self.json)
            reports.append(report)
        solved = sum(report.solution.solved for report in reports)
        robot = "engine" if CHOSEN is DOOM else "robot"
        said = (
            f"{solved} of {len(reports)} tasks solved: all five goals reached on the {robot}, byte for byte"
        )
        if not self.json:
            print(said)
        save_page(self.out, reports, quiet=self.json)


def shipped_tasks() -> list[Path]:
    """The task folders that come with evaps; they are of the Doom robot."""
    if CHOSEN is not DOOM:
        return []
    return sorted(path.parent for root in SHIPPED_TASKS for path in root.glob("*/task.json"))


def random_tasks(number: int) -> list[Task]:
    """Test tasks of the first seeds; see `evaps.tasks.generate.unseen_task`."""
    from evaps.robots.world import world
    from evaps.tasks.generate import unseen_task

    with closing(world().robot()) as robot:
        return [unseen_task(seed, robot) for seed in range(number)]


def solve_all(
    tasks: Sequence[Task],
    model: Model,
    top_k: int = 20,
    rounds: int = 5,
    budget: Budget | None = None,
    seed: int = 0,
) -> Iterator[TaskReport]:
    """Synthesize for each task on the same engines.

    On one thread: a second one gains a tenth, and where another program needs its core, torch's threads wait
    for each other and a task takes ten times as long.
    """
    import torch

    torch.set_num_threads(1)
    from evaps.synthesis import Budget, Watch, memo_of, solve, team_of_robots
    from evaps.tasks.progress import CONSOLE, LOUDNESS
    from evaps.viewer import TaskReport

    def tell(news: News) -> None:
        CONSOLE.print(f"{news.seconds:.1f} s, {news.actions} actions: {news.text}", highlight=False)

    team = team_of_robots()
    watch = Watch(tell) if LOUDNESS.verbose else Watch()
    try:
        for task in tasks:
            memo = memo_of(team)  # it lives as long as its views: the page shows them
            yield TaskReport(task, solve(model, task, memo, top_k, rounds, budget or Budget(), seed, watch))
            memo.leave()
    finally:
        for robot in team:
            robot.close()


def show(report: TaskReport, as_json: bool) -> None:
    """Print one solution."""
    if as_json:
        print(json.dumps(report.solution.to_json()), flush=True)
        return
    from rich.console import Console

    from evaps.viewer import show_solution

    show_solution(Console(highlight=False), report)


def show_doubt(report: TaskReport) -> None:
    """Print what the five examples leave open: the user may add an example like it."""
    doubt = report.solution.doubt
    if doubt is None:
        print("No scene is known on which another program that passes all examples does otherwise.")
        return
    scene, program = doubt
    print("The examples leave open what is to be done here:", json.dumps(scene.to_json()))
    print("There this program, which passes all of them too, does otherwise:")
    print(program.to_python())


def save_page(path: Path, reports: Sequence[TaskReport], quiet: bool) -> None:
    """Write the report page and say where it is."""
    from evaps.viewer import write_page

    with writing(path):
        write_page(path, reports)
    if not quiet:
        print(f"page: {path.resolve()}")
