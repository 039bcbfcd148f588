"""Reading files that may be damaged: text, JSON and Parquet, with one clear line about what is wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from evaps.dsl import UserError


def read_text(path: Path, error: type[UserError] = UserError) -> str:
    """The content of a UTF-8 file.

    Raises:
        UserError: of the type ``error``: it is missing, a folder, unreadable, or not UTF-8.
    """
    try:
        return decode(path.read_bytes(), str(path), error)
    except FileNotFoundError:
        raise error(f"{path} is missing; check the name") from None
    except IsADirectoryError:
        raise error(f"{path} is a folder; name a file") from None
    except NotADirectoryError:
        raise error(f"{path} is missing; a part of this path is a file, not a folder") from None
    except OSError as fault:
        raise error(f"{path} cannot be read: {fault.strerror}") from None


def decode(content: bytes, name: str, error: type[UserError] = UserError) -> str:
    """UTF-8 bytes as text; ``name`` tells the user where they come from.

    Raises:
        UserError: of the type ``error``: they are not UTF-8.
    """
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        line = content.count(b"\n", 0, fault.start) + 1
        raise error(f"{name} is not UTF-8 text: byte {content[fault.start]:#04x} in line {line}") from None


def read_json(path: Path, error: type[UserError] = UserError) -> Any:
    """The value in a JSON file.

    Raises:
        UserError: of the type ``error``: it cannot be read, or is not JSON; with line and column.
    """
    text = read_text(path, error)
    try:
        return json.loads(text)
    except json.JSONDecodeError as fault:
        raise error(f"{path} is not JSON: line {fault.lineno}, column {fault.colno}: {fault.msg}") from None
    except (ValueError, RecursionError):
        raise error(f"{path} cannot be read: a number is too long or values nest too deeply") from None


def read_json_lines(path: Path, error: type[UserError] = UserError) -> list[Any]:
    """The values in a file that has one in each line.

    Raises:
        UserError: of the type ``error``: it cannot be read, or a line is not JSON.
    """
    values = []
    for number, line in enumerate(read_text(path, error).splitlines(), 1):
        try:
            values.append(json.loads(line))
        except ValueError:
            raise error(f"{path} has no JSON value in line {number}; make the file again") from None
    return values


def read_table(path: Path, error: type[UserError] = UserError, **options: Any) -> pa.Table:
    """The table in a Parquet file.

    Args:
        path: of the file.
        error: what to raise.
        options: of `pyarrow.parquet.read_table`.

    Raises:
        UserError: of the type ``error``: it is missing, or damaged.
    """
    try:
        return pq.read_table(path, **options)
    except FileNotFoundError:
        raise error(f"{path} is missing") from None
    except (pa.ArrowException, OSError) as fault:
        reason = " ".join(str(fault).split())[:120]
        raise error(f"{path} is damaged ({reason}); delete it, and what made it makes it again") from None
