"""Programs and scenes from files, and files for what comes out."""

from __future__ import annotations

import errno
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile
from typing import Annotated, Any, TypeAlias

from tyro.conf import arg

from evaps.dsl import Program, ProgramError, UserError
from evaps.robots.base import Scene, SceneError
from evaps.robots.world import world
from evaps.tasks.files import decode, read_json, read_text

ProgramFile: TypeAlias = Annotated[str, arg(metavar="FILE|-")]
File: TypeAlias = Annotated[Path, arg(metavar="FILE")]
MaybeFile: TypeAlias = Annotated[Path | None, arg(metavar="FILE")]
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
        world().validate(scene)
    except SceneError as error:
        raise UserError(f"{where}: {error}") from error
    return scene


def check_least(**least: tuple[int, int]) -> None:
    """Check options that are numbers: each value, and the least that it may be.

    Raises:
        UserError: a value is too small.
    """
    for name, (value, smallest) in least.items():
        if value < smallest:
            raise UserError(f"--{name.replace('_', '-')} must be at least {smallest}, not {value}")


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turns what forbids to write at this place into a user's error; a full disk is not one.

    Raises:
        UserError: nothing can be written there.
    """
    try:
        yield
    except OSError as error:
        if error.errno == errno.ENOSPC or not _concerns(error, path):
            raise
        raise UserError(f"{path} cannot be written: {error.strerror}; choose another place") from error


def _concerns(error: OSError, path: Path) -> bool:
    """Whether the error is about the path, what is in it, or a folder on the way to it."""
    if not isinstance(error.filename, str):
        return False
    there, named = path.absolute(), Path(error.filename).absolute()
    return named.parent == there.parent or there in named.parents or named in there.parents


def check_writable(path: Path) -> None:
    """Find out before long work whether a file can be written there.

    Raises:
        UserError: it cannot.
    """
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_dir():
            raise UserError(f"{path} is a folder; name a file")
        with TemporaryFile(dir=path.parent):
            pass
