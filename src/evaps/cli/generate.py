"""``evaps generate``: a data set of random tasks."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import ClassVar

from tyro.conf import Positional

from evaps.cli.command import Command
from evaps.cli.inputs import Folder, check_least, writing


def available_cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True)
class Generate(Command):
    """Make a data set of random tasks with distinct programs, or go on with one.

    A task depends on the seed and its index alone, not on the number of workers.
    """

    stopped: ClassVar[str] = "stopped; nothing is lost: the same command goes on where it was"

    out: Positional[Folder]
    """Folder of the data set; new, empty, or one that was begun with the same seed."""
    tasks: int = 20_000
    """How many tasks."""
    seed: int = 0
    """Of everything random, from 0."""
    workers: int = field(default_factory=available_cores)
    """Processes that simulate, each with an engine; by default one a core. 0 works in this process."""

    def run(self) -> None:
        """Generate, with progress on standard error."""
        check_least(tasks=(self.tasks, 1), seed=(self.seed, 0), workers=(self.workers, 0))
        from evaps.tasks.dataset import generate

        with writing(self.out):
            self.out.mkdir(parents=True, exist_ok=True)
            indices = generate(self.out, self.tasks, self.seed, self.workers)
        print(f"{self.out}: {self.tasks} tasks with distinct programs, out of {indices}")
