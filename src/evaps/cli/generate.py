"""``evaps generate``: a data set of random tasks. ``evaps render``: its frames, where they were left out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from tyro.conf import Positional, arg

from evaps.cli.command import Command, print_result
from evaps.cli.inputs import Folder, check_least, writing
from evaps.cli.workers import Engine, available_cores, workers_from
from evaps.dsl import UserError


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
    """Processes that simulate, each with engines; by default one a core. 0 works in this process."""
    engine: Engine = "local"
    """Where they run: local processes, or a Ray cluster."""
    address: Annotated[str | None, arg(metavar="ADDRESS")] = None
    """Of a running Ray cluster; else RAY_ADDRESS, else one is started on this machine."""
    shard: Annotated[str, arg(metavar="I/N")] = "1/1"
    """The I-th of N shares, for several machines; all in one folder are joined by once more without this."""
    no_frames: bool = False
    """Leave out the first and last observations; `evaps render` makes them later."""
    json: bool = False
    """Print one JSON object."""

    def run(self) -> None:
        """Generate, with progress on standard error."""
        shard = read_shard(self.shard)
        check_least(tasks=(self.tasks, 1), seed=(self.seed, 0))
        workers = workers_from(self.workers, self.engine, self.address)
        from evaps.tasks.build import generate

        with writing(self.out):
            self.out.mkdir(parents=True, exist_ok=True)
            frames = not self.no_frames
            indices = generate(self.out, self.tasks, self.seed, workers, shard=shard, frames=frames)
        facts = {"data": self.out, "tasks": self.tasks, "indices": indices, "shard": self.shard}
        said = f"{self.out}: {self.tasks} tasks with distinct programs, out of {indices}"
        if shard[1] > 1:
            said = f"{self.out}: share {self.shard}, {indices} tasks"
        print_result(said, facts, self.json)


def read_shard(text: str) -> tuple[int, int]:
    """Which share, from 1, and of how many.

    Raises:
        UserError: it is not of the form I/N.
    """
    share, _, shards = text.partition("/")
    if not (share.isdecimal() and shards.isdecimal() and 1 <= int(share) <= int(shards)):
        raise UserError(f"--shard must be I/N with I from 1 to N, such as 2/3, not {text!r}")
    return int(share), int(shards)


@dataclass(frozen=True)
class Render(Command):
    """Make the frames of a data set that was generated with --no-frames, or go on with it.

    With --traces, those in the middle of each run too, which some methods learn from.
    """

    stopped: ClassVar[str] = "stopped; nothing is lost: the same command goes on where it was"

    data: Positional[Folder]
    """Folder of the data set."""
    workers: int = field(default_factory=available_cores)
    """Processes that simulate; by default one a core."""
    engine: Engine = "local"
    """Where they run: local processes, or a Ray cluster."""
    address: Annotated[str | None, arg(metavar="ADDRESS")] = None
    """Of a running Ray cluster; else RAY_ADDRESS, else one is started on this machine."""
    traces: bool = False
    """All observations of the runs, with the perceptions that are true in them; 200 KB a task."""
    json: bool = False
    """Print one JSON object."""

    def run(self) -> None:
        """Render, with progress on standard error."""
        workers = workers_from(self.workers, self.engine, self.address)
        from evaps.tasks.render import render

        with writing(self.data):
            tasks = render(self.data, workers, self.traces)
        said = f"{self.data}: {tasks} tasks with {'traces' if self.traces else 'frames'}"
        print_result(said, {"data": self.data, "tasks": tasks, "traces": self.traces}, self.json)
