"""Files of evaluation rows: finding them, reading them, and whether they belong together."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

import pyarrow as pa

from evaps.dsl import UserError
from evaps.tasks.files import read_table

ONE_SETTING = ("dataset_seed", "split", "noise", "top_k", "most_rounds")
"""Columns that have to be the same in rows that are compared."""


def read_rows(file: Path, needed: Collection[str]) -> pa.Table:
    """The rows in a file.

    Args:
        file: of ``evaps evaluate``.
        needed: columns that it has to have.

    Raises:
        UserError: it cannot be read, or holds something else.
    """
    table = read_table(file)
    if missing := sorted(set(needed) - set(table.column_names)):
        raise UserError(f"{file} holds no rows of evaps evaluate: it has no column {missing[0]!r}")
    if not len(table):
        raise UserError(f"{file} holds no rows; evaluate again")
    return table


def row_files(path: Path) -> list[Path]:
    """A file of rows, or those in a folder, in the order of their names.

    Raises:
        UserError: there are none.
    """
    if path.is_file() and path.suffix != ".parquet":
        raise UserError(f"{path} is no file of rows; those of evaps evaluate end in .parquet")
    files = sorted(path.glob("*.parquet")) if path.is_dir() else [path]
    if not files or not files[0].exists():
        raise UserError(f"{path} holds no rows; make some with: evaps evaluate --out {path}/NAME.parquet")
    return files


def check_one_setting(tables: Sequence[pa.Table]) -> None:
    """Whether rows may be compared.

    Raises:
        UserError: a column in ONE_SETTING differs.
    """
    for column in ONE_SETTING:
        there = [table[column].unique().to_pylist() for table in tables if column in table.column_names]
        values = sorted({value for found in there for value in found if value is not None})
        if len(values) > 1:
            shown = ", ".join(f"{value:.4g}" if column == "noise" else f"{value}" for value in values)
            raise UserError(
                f"these rows are of more than one {column}: {shown}; put each kind into a folder of its own"
            )
