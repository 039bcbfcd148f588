"""A table, and how it is written for pages, for papers and for programs."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from evaps.report.dots import DotPlot


@dataclass(frozen=True)
class Table:
    """Cells are text already.

    Attributes:
        title: one line.
        head: names of the columns.
        rows: the first cell of each says what it is about.
        notes: sentences below it: scale, seeds, what is meant.
        number: of the paper's table that this is; LaTeX counts by itself.
        picture: the same to look at.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    notes: Sequence[str] = ()
    number: int | None = None
    picture: DotPlot | None = None

    def markdown(self) -> str:
        """With its title and its notes."""
        number = f"Table {self.number}. " if self.number else ""
        cells = markdown_cells(self.head, self.rows)
        return "\n\n".join([f"**{number}{self.title}**", cells, *self.notes]) + "\n"

    def latex(self) -> str:
        """A ``table`` environment that needs the package booktabs; the notes stand below the rows."""
        lines = [
            r"\begin{table}",
            rf"\caption{{{_escaped(self.title)}}}",
            rf"\begin{{tabular}}{{l{'r' * (len(self.head) - 1)}}}",
            r"\toprule",
            *(" & ".join(map(_escaped, row)) + r" \\" for row in [self.head]),
            r"\midrule",
            *(" & ".join(map(_escaped, row)) + r" \\" for row in self.rows),
            r"\bottomrule",
            r"\end{tabular}",
            *(rf"\par\smallskip\footnotesize {_escaped(note)}" for note in self.notes),
            r"\end{table}",
        ]
        return "\n".join(lines) + "\n"

    def csv(self) -> str:
        """Head and rows."""
        out = io.StringIO()
        csv.writer(out, lineterminator="\n").writerows([self.head, *self.rows])
        return out.getvalue()


def markdown_cells(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """The cells alone, as Markdown; all columns but the first are of numbers."""
    lines = [f"| {' | '.join(head)} |", f"|---{'|---:' * (len(head) - 1)}|"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)])


def _escaped(text: str) -> str:
    for sign in "&%_#$":
        text = text.replace(sign, "\\" + sign)
    text = re.sub(r"`([^`]*)`", r"\\texttt{\1}", text)
    return text.replace("±", r"$\pm$").replace("−", "--")
