"""``evaps report``: tables and figures from evaluation rows."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from evaps.cli.command import Command, print_result
from evaps.cli.inputs import writing


@dataclass(frozen=True)
class Report(Command):
    """Make a table or a figure from the rows of `evaps evaluate`.

    All become Markdown, LaTeX and CSV; table-1, table-2 and the figures PNG and SVG, too. There are table-1,
    table-2, differences, frames, checked, complexity, candidates, actions, seconds, rounds, effects, edits,
    noise, sizes and learning; or all.
    """

    name: Annotated[Positional[str], arg(metavar="NAME")]
    """Which of these, or all."""
    rows: Annotated[Path, arg(metavar="PATH")]
    """A Parquet file of rows, or a folder of such files."""
    out: Annotated[Path, arg(metavar="DIR")] = Path("report")
    """Folder for what is made."""
    json: bool = False
    """Print one JSON object."""

    def run(self) -> None:
        """Make it, and print the names of the files."""
        from evaps.report import report

        with writing(self.out):
            made = [str(path) for path in report(self.name, self.rows, self.out)]
        print_result("\n".join(made), {"files": made}, self.json)
