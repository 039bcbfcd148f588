"""``evaps data info``: what is in a data set, and whether it still holds."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from evaps.cli.command import Command
from evaps.cli.inputs import Folder, check_least
from evaps.dsl import UserError

if TYPE_CHECKING:
    from evaps.tasks.info import Summary


@dataclass(frozen=True)
class Data(Command):
    """Show what is in a data set, and run a sample of its tasks again: `evaps data info DIR`.

    Counts, lengths, steps, control flow, perceptions and sizes. Exit status 2 if a task no longer does what
    the data set says.
    """

    what: Annotated[Positional[Literal["info"]], arg(metavar="info")]
    """What to do with it."""
    folder: Positional[Folder]
    """Folder of the data set, from `evaps generate`."""
    check: int = 20
    """How many tasks are run again, evenly spread; 0 for none."""
    json: bool = False
    """Print one JSON object."""

    def run(self) -> None:
        """Count, check, and print."""
        check_least(check=(self.check, 0))
        from evaps.dsl.sampler import PERCEPTION_KEYS
        from evaps.robots.memo import MemoRobot
        from evaps.robots.world import world
        from evaps.tasks.dataset import Dataset
        from evaps.tasks.info import check, summarize

        dataset = Dataset(self.folder)
        summary = summarize(dataset)
        robot = MemoRobot(world().robot(), PERCEPTION_KEYS, eager=False)
        try:
            faults = check(dataset, self.check, robot)
        finally:
            robot.close()
        checked = min(self.check, len(dataset))
        if self.json:
            print(json.dumps({**asdict(summary), "checked": checked, "faults": faults}))
        else:
            show(summary, len(dataset))
            print(f"{checked} tasks run again, {len(faults)} of them differ")
        if faults:
            raise UserError(f"{self.folder}: {faults[0]}")


def show(summary: Summary, tasks: int) -> None:
    """Print a summary as a table."""
    from rich.console import Console
    from rich.table import Table

    table = Table("what", "", show_header=False, box=None)

    def counts(found: Mapping[str, int]) -> str:
        return ", ".join(f"{key} {count} ({100 * count / tasks:.0f} %)" for key, count in found.items())

    table.add_row("tasks", f"{tasks} with distinct programs")
    table.add_row("made by", ", ".join(f"{key} {value}" for key, value in summary.identity.items()))
    table.add_row("splits", counts(summary.splits))
    table.add_row("tokens", "{} to {}, mean {:.2f}".format(*(summary.tokens[i] for i in (0, 2, 1))))
    table.add_row("steps", "{} to {}, mean {:.2f}".format(*(summary.steps[i] for i in (0, 2, 1))))
    table.add_row("by steps", counts(summary.buckets))
    table.add_row("with", counts(summary.control))
    table.add_row("asking", counts(summary.perceptions))
    table.add_row("doing", counts(summary.actions))
    sizes = summary.bytes_per_task.items()
    table.add_row("bytes a task", ", ".join(f"{name} {size:,.0f}" for name, size in sizes))
    Console(highlight=False).print(table)
