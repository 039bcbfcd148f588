"""A table, and how it is written for pages, for papers and for programs."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from evaps.report.dots import DotPlot

WIDE = 6  # columns; more do not fit into one of a page's
SIGNS = {sign: f"\\{sign}" for sign in "&%_#${}"} | {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
}


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
        """A ``table`` environment that needs the package booktabs; the notes stand below the rows.

        Many columns are made as wide as the text, over both columns of a page, with the package graphicx.
        """
        wide = len(self.head) > WIDE
        kind = "table*" if wide else "table"
        lines = [
            rf"\begin{{{kind}}}",
            rf"\caption{{{_escaped(self.title)}}}",
            *([r"\resizebox{\textwidth}{!}{%"] if wide else []),
            rf"\begin{{tabular}}{{l{'r' * (len(self.head) - 1)}}}",
            r"\toprule",
            " & ".join(map(_escaped, self.head)) + r" \\",
            r"\midrule",
            *(" & ".join(map(_escaped, row)) + r" \\" for row in self.rows),
            r"\bottomrule",
            r"\end{tabular}" + ("}" if wide else ""),
            *(rf"\par\smallskip\footnotesize {_escaped(note)}" for note in self.notes),
            rf"\end{{{kind}}}",
        ]
        return "\n".join(lines) + "\n"

    def csv(self) -> str:
        """Head and rows; of a table with a picture the numbers in it, each in a row of its own."""
        return csv_of(self.picture.records() if self.picture else [self.head, *self.rows])


def csv_of(rows: Iterable[Sequence[str]]) -> str:
    """Rows as comma-separated values; numbers without commas for their thousands."""
    out = io.StringIO()
    bare = ([re.sub(r"(?<=\d),(?=\d{3}\b)", "", cell) for cell in row] for row in rows)
    csv.writer(out, lineterminator="\n").writerows(bare)
    return out.getvalue()


def markdown_cells(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """The cells alone, as Markdown; all columns but the first are of numbers."""
    lines = [f"| {' | '.join(head)} |", f"|---{'|---:' * (len(head) - 1)}|"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)])


def _escaped(text: str) -> str:
    text = "".join(SIGNS.get(sign, sign) for sign in text)
    text = re.sub(r"`([^`]*)`", r"\\texttt{\1}", text)
    text = re.sub(r"(?<![\w.])[-+](?=\d)", lambda sign: f"${sign.group()}$", text)  # signs, and no hyphens
    return text.replace("±", r"$\pm$").replace("−", "$-$")
