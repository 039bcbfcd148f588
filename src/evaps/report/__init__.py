"""Tables and figures from evaluation rows, by their names: as Markdown, LaTeX, CSV, PNG and SVG."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

from evaps.dsl import UserError
from evaps.files import write_atomically
from evaps.metrics import Results
from evaps.report import comparisons, curves, repairs, tables
from evaps.report.drawing import can_draw
from evaps.report.figure import Figure
from evaps.report.table import Table, csv_of
from evaps.report.wording import scale_note
from evaps.tasks.progress import track

Item = Table | Figure
REPORTS: dict[str, Callable[[Results], Item | list[Table]]] = {
    "table-1": tables.table_1,
    "table-2": tables.table_2,
    "differences": comparisons.differences,
    "frames": comparisons.frames,
    "checked": comparisons.checked,
    "complexity": curves.complexity,
    "candidates": curves.candidates,
    "actions": curves.actions,
    "seconds": curves.seconds,
    "rounds": repairs.rounds,
    "effects": repairs.effects,
    "edits": repairs.edits,
}
"""Every report by its name."""
NOISE = "noise"
"""The report that needs rows with noise and without it, ``ROWS/noise/*.parquet``."""
SIZES = "sizes"
"""The report that needs rows of trainings on fewer tasks, ``ROWS/sizes/*.parquet``."""
LEARNING = "learning"
"""The report that is made of ``ROWS/curves/METHOD-SEED.jsonl``, the metrics of trainings."""
SEARCHED = "searches"
"""A folder of rows of searches, which have no twenty candidates, ``ROWS/searches/*.parquet``."""
BUDGETS = ("actions", "seconds")
"""The reports that show these searches, too, if there are rows of them."""
FURTHER = {NOISE: "noise", SIZES: "sizes", LEARNING: "curves"}
"""The folder beside the rows that each of these needs."""


def report(name: str, rows: Path, out: Path) -> list[Path]:
    """Make a report, or all of them; the files that were written.

    Args:
        name: in REPORTS, NOISE, SIZES, LEARNING, or ``"all"``.
        rows: a file of evaluation rows, or a folder of such files.
        out: folder of the files.

    Raises:
        UserError: there is no such report, there are no rows, they have nothing that it could show, or a
            library is missing.
    """
    known = (*REPORTS, *FURTHER)
    if name not in (*known, "all"):
        raise UserError(f"there is no report {name!r}; known are {', '.join((*known, 'all'))}")
    written = []
    read = cache(Results.read)  # once for all reports, and only for those that need them
    names = (*REPORTS, *_further(rows)) if name == "all" else (name,)
    for each in track(names, len(names), "reports"):
        if _shows_something(made := _make(each, rows, read)):
            written += _write(each, made, out)
        elif name != "all":
            raise UserError(f"{rows} holds nothing that {name} could show; see docs/evaluation.md")
    return written


def _shows_something(made: Item | list[Table]) -> bool:
    if isinstance(made, Figure):
        return any(len(line.x) for lines in made.panels.values() for line in lines.values())
    return any(table.rows for table in (made if isinstance(made, list) else [made]))


def _further(rows: Path) -> list[str]:
    """The reports for which there is more than rows."""
    return [name for name, folder in FURTHER.items() if any((rows / folder).glob("*.*"))]


def _make(name: str, rows: Path, read: Callable[..., Results]) -> Item | list[Table]:
    if name in FURTHER and rows.is_file():
        raise UserError(
            f"{name} needs the folder of rows that has {FURTHER[name]}/ in it, not the file {rows}"
        )
    if name == LEARNING:
        if LEARNING not in _further(rows):
            raise UserError(f"{rows / 'curves'} holds no METHOD-SEED.jsonl, the metrics.jsonl of trainings")
        return curves.learning(rows / FURTHER[LEARNING])
    if name == SIZES:
        if SIZES not in _further(rows):
            raise UserError(f"{rows / FURTHER[SIZES]} is missing; make it with: python -m recipes.sizes")
        return curves.sizes(Results.by_column(rows / FURTHER[SIZES], "trained_on"))
    if name == NOISE:
        if NOISE not in _further(rows):
            raise UserError(f"{rows / FURTHER[NOISE]} holds no rows; make them with: python -m recipes.paper")
        return curves.noise(Results.by_column(rows / FURTHER[NOISE], "noise"))
    searches = [rows / SEARCHED] if name in BUDGETS and any((rows / SEARCHED).glob("*.parquet")) else []
    shown = read(rows, *searches)
    made = REPORTS[name](shown)
    return replace(made, notes=(*made.notes, scale_note(shown))) if isinstance(made, Figure) else made


def _titled(table: Table) -> str:
    """Several tables in one file have a first column that says which one a row is of."""
    return csv_of([["table", *table.head], *([table.title, *row] for row in table.rows)])


def _write(name: str, made: Item | list[Table], out: Path) -> list[Path]:
    pictures: dict[str, bytes] = {}
    if isinstance(made, Figure):
        pictures, csv, tables = made.draw(), made.csv(), made.tables()
    else:
        tables = made if isinstance(made, list) else [made]
        csv = tables[0].csv() if len(tables) == 1 else "\n".join(map(_titled, tables))
        if can_draw():  # a table is one without its picture, too
            pictures = {kind: p for t in tables if t.picture for kind, p in t.picture.draw().items()}
    texts = {
        "md": "\n".join(table.markdown() for table in tables),
        "tex": "\n".join(table.latex() for table in tables),
        "csv": csv,
    }
    contents = {**{kind: text.encode() for kind, text in texts.items()}, **pictures}
    for kind, content in contents.items():
        write_atomically(out / f"{name}.{kind}", content)
    return [out / f"{name}.{kind}" for kind in contents]
