"""``evaps bench``: how fast things are on this machine."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass

from evaps.cli.command import Command
from evaps.cli.inputs import MaybeFile, check_least, check_writable
from evaps.domain import CHOSEN, DOOM, VARIABLE
from evaps.dsl import UserError


@dataclass(frozen=True)
class Bench(Command):
    """Measure the engine, execution, memoised worlds, data generation, features, synthesis and training.

    Everything is measured in one run and compared in turns, since machines are noisy: ratios (x) say more
    than rates. Nothing else should run meanwhile.
    """

    model: str = CHOSEN.model
    """A shipped set of checkpoints, a folder of them, or hub:OWNER/NAME."""
    seconds: float = 5.0
    """About how long each rate is measured."""
    batch: int = 32
    """Programs that a method learns from at a time."""
    out: MaybeFile = None
    """Write the figures as JSON lines, with the machine and the commit."""
    json: bool = False
    """Print these lines instead of the table."""

    def run(self) -> None:
        """Measure, and print a table."""
        if CHOSEN is not DOOM:
            raise UserError(f"bench measures the domain doom, not {CHOSEN.name}; unset {VARIABLE}")
        if not self.seconds > 0:
            raise UserError(f"--seconds must be more than 0, not {self.seconds:g}")
        check_least(batch=(self.batch, 1))
        if self.out is not None:
            check_writable(self.out)
        from rich.console import Console
        from rich.table import Table

        from evaps.bench import bench, machine
        from evaps.files import write_atomically
        from evaps.tasks.identity import code_version
        from evaps.tasks.progress import CONSOLE, LOUDNESS

        console = Console(highlight=False)
        table = Table("what", "measured", "unit", "target", title=machine())
        table.columns[1].justify = "right"
        rows = []
        for figure in bench(self.model, self.seconds, self.batch):
            if not LOUDNESS.quiet:
                CONSOLE.print(f"{figure.name}: {figure.value:.4g} {figure.unit}", highlight=False)
            table.add_row(figure.name, f"{figure.value:.4g}", figure.unit, figure.target)
            rows.append({**asdict(figure), "machine": machine(), "commit": code_version()})
        lines = "".join(json.dumps(row) + "\n" for row in rows)
        if self.json:
            print(lines, end="")
        else:
            console.print(table)
        if self.out is not None:
            write_atomically(self.out, lines.encode())
