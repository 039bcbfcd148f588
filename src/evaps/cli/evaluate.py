"""``evaps evaluate``: exact, semantic and generalization match of methods on a data set."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from tyro.conf import arg

from evaps.cli.command import Command
from evaps.cli.inputs import File, Folder, check_least, check_writable
from evaps.cli.workers import Engine, available_cores, workers_from
from evaps.domain import CHOSEN
from evaps.dsl import UserError


@dataclass(frozen=True)
class Evaluate(Command):
    """Judge methods on tasks that they were not trained on; one row for each method, task and rank.

    Prints a table in %: exact, semantic (five examples) and generalization match (six) at top-1 / 5 / 20, and
    how often the answer, the first candidate that passes most of the five, generalizes.
    """

    stopped: ClassVar[str] = "stopped; the same command goes on, with the tasks that were being judged"

    data: Folder
    """Folder of the data set, from `evaps generate`."""
    out: File
    """Parquet file for the rows."""
    model: str = CHOSEN.model
    """A shipped set of checkpoints, a folder of them, or hub:OWNER/NAME."""
    methods: tuple[str, ...] = ("lgrl", "evaps", "verified")
    """Who is judged; evaps repairs the candidates of lgrl, transformer+evaps those of transformer."""
    split: str = "test"
    """train, validation or test."""
    tasks: int = 1000
    """How many tasks of the split; all if it has fewer."""
    top_k: int = 20
    """Candidates of a task."""
    rounds: int = 5
    """How often a candidate is repaired at most."""
    actions: int = CHOSEN.budget
    """How many actions a search may simulate for a task."""
    noise: float = 0.0
    """Share of the pixels that are invalid in all that methods see, from 0 to 1."""
    workers: int = field(default_factory=available_cores)
    """Processes; by default one a core."""
    engine: Engine = "local"
    """Where they run: local processes, or a Ray cluster, whose nodes need the model."""
    address: Annotated[str | None, arg(metavar="ADDRESS")] = None
    """Of a running Ray cluster; else RAY_ADDRESS, else one is started on this machine."""
    json: bool = False
    """Print one JSON object a method instead of the table, a line each; shares are from 0 to 1."""

    def run(self) -> None:
        """Evaluate, with progress on standard error, and print the table."""
        if self.out.suffix != ".parquet":
            raise UserError(f"--out must end in .parquet, not {self.out.name!r}")
        check_least(
            tasks=(self.tasks, 1), top_k=(self.top_k, 1), rounds=(self.rounds, 0), actions=(self.actions, 1)
        )
        if not 0 <= self.noise < 1:
            raise UserError(f"--noise must be at least 0 and less than 1, not {self.noise}")
        workers = workers_from(self.workers, self.engine, self.address)
        check_writable(self.out)
        from evaps.evaluate import evaluate
        from evaps.metrics import Results
        from evaps.report.summary import summary_table, summary_values

        evaluate(
            self.data,
            self.out,
            self.model,
            self.methods,
            self.split,
            self.tasks,
            self.top_k,
            self.rounds,
            workers,
            self.noise,
            self.actions,
        )
        results = Results.read(self.out)
        if self.json:
            for values in summary_values(results):
                print(json.dumps(values))
        else:
            print(summary_table(results))
