"""Programs and scenes from files, and files for what comes out."""

from __future__ import annotations

import errno
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, TypeAlias

from tyro.conf import arg

from evaps.dsl import Program, ProgramError, UserError
from evaps.robots.base import Scene, SceneError
from evaps.robots.scenes import validate
from evaps.tasks.files import decode, read_json, read_text

ProgramFile: TypeAlias = Annotated[str, arg(metavar="FILE|-")]
File: TypeAlias = Annotated[Path, arg(metavar="FILE")]
Folder: TypeAlias = Annotated[Path, arg(metavar="DIR")]


def read_program(path: str) -> Program:
    """The program in a file, in either form; ``-`` reads standard input.

    Raises:
        UserError: the file cannot be read or holds no program.
    """
    name = "standard input" if path == "-" else path
    text = decode(sys.stdin.buffer.read(), name) if path == "-" else read_text(Path(path))
    try:
        return Program.parse(text)
    except ProgramError as error:
        raise UserError(f"{name}: {error}") from error


def read_scene(path: Path) -> Scene:
    """The scene in a JSON file.

    Raises:
        UserError: the file cannot be read or holds no valid scene.
    """
    return _scene(read_json(path), str(path))


def read_scenes(path: Path, count: int) -> list[Scene]:
    """The scenes in a JSON file that is a list of so many.

    Raises:
        UserError: the file cannot be read or holds something else.
    """
    value = read_json(path)
    if not isinstance(value, list) or len(value) != count:
        found = f"a list of {len(value)}" if isinstance(value, list) else "no list"
        raise UserError(f"{path}: expected a list of exactly {count} scenes, found {found}")
    return [_scene(item, f"{path}: scenes[{i}]") for i, item in enumerate(value)]


def _scene(value: Any, where: str) -> Scene:
    try:
        scene = Scene.from_json(value)
        validate(scene)
    except SceneError as error:
        raise UserError(f"{where}: {error}") from error
    return scene


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turns what forbids to write at this place into a user's error; a full disk is not one.

    Raises:
        UserError: nothing can be written there.
    """
    try:
        yield
    except OSError as error:
        if error.filename is None or error.errno == errno.ENOSPC:
            raise
        raise UserError(f"{path} cannot be written: {error.strerror}; choose another place") from error
