"""Tasks: what a method is given, and what only the evaluation knows."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image as Picture

from evaps.domain import CHOSEN
from evaps.dsl import Program, UserError
from evaps.robots.base import Scene, SceneError, WorldState
from evaps.robots.frames import Image, Observation, RgbFrame
from evaps.robots.noise import noisy
from evaps.robots.world import world
from evaps.tasks.files import read_json

EXAMPLES = 5
FORMAT = 1


class TaskError(UserError):
    """A task folder that cannot be read; the message says what is wrong, in one line."""


@dataclass(frozen=True)
class Example:
    """A scene to start from, and what the robot should see at the end."""

    scene: Scene
    goal: Observation


@dataclass(frozen=True)
class Task:
    """All that a method sees: the specification examples of one unknown program.

    Attributes:
        name: what it is called.
        examples: scenes and goals.
        noise: share of the pixels that are invalid in everything that the robot sees, goals included.
    """

    name: str
    examples: tuple[Example, ...]
    noise: float = 0.0

    def with_noise(self, share: float) -> Task:
        """The same task, seen through noise."""
        seen = (Example(e.scene, noisy(e.goal, share)) for e in self.examples)
        return Task(self.name, tuple(seen), share)


@dataclass(frozen=True)
class Outcome:
    """Where the unknown program leads from a scene: kept for evaluation."""

    scene: Scene
    goal: Observation
    state: WorldState


@dataclass(frozen=True)
class GoldTask:
    """A task with its answer. Methods get `task` and nothing else of it.

    Attributes:
        name: the task's name.
        program: the program that made it.
        outcomes: its outcomes on the specification scenes and, last, on the test scene.
        steps: the most actions that the program executes on one of these scenes.
    """

    name: str
    program: Program
    outcomes: tuple[Outcome, ...]
    steps: int

    @property
    def task(self) -> Task:
        """The specification: what a method may see."""
        return Task(self.name, tuple(Example(o.scene, o.goal) for o in self.outcomes[:EXAMPLES]))


def save_task(task: Task, folder: Path) -> None:
    """Write a task folder: ``task.json`` and two lossless PNGs an example.

    The folder is complete or not there: it is written under another name and moved into place.

    Raises:
        TaskError: the folder exists already.
    """
    if folder.exists():
        raise TaskError(f"{folder} exists already; choose another folder or remove it")
    part = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    part.mkdir(parents=True)
    try:
        _write_examples(task, part)
        part.rename(folder)
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        raise


def _write_examples(task: Task, folder: Path) -> None:
    entries = []
    for i, example in enumerate(task.examples):
        entries.append({"scene": example.scene.to_json(), "goal_rgb": f"goal{i}.png"})
        entries[-1]["goal_depth"] = f"goal{i}_depth.png"
        Picture.fromarray(example.goal.rgb).save(folder / f"goal{i}.png", optimize=True)
        Picture.fromarray(example.goal.depth).save(folder / f"goal{i}_depth.png", optimize=True)
    (folder / "task.json").write_text(json.dumps({"format": FORMAT, "examples": entries}, indent=1) + "\n")


def load_task(folder: str | os.PathLike[str]) -> Task:
    """Read a task folder of this process's domain.

    Args:
        folder: where ``task.json`` and its images are.

    Raises:
        TaskError: something is missing, unknown or of the wrong form; the message says where.
    """
    path = Path(folder)
    value = _read_json(path / "task.json")
    _check(set(value) == {"format", "examples"}, path, "expected the keys 'format' and 'examples'", value)
    _check(value["format"] == FORMAT, path, f"format must be {FORMAT}, not {value['format']!r}")
    examples = value["examples"]
    found = len(examples) if isinstance(examples, list) else "no list"
    _check(found == EXAMPLES, path, f"examples must be a list of {EXAMPLES}, found {found}")
    return Task(path.resolve().name, tuple(_example(path, i, e) for i, e in enumerate(examples)))


def _read_json(path: Path) -> dict[str, Any]:
    if path.parent.is_dir() and not path.exists():
        raise TaskError(f"{path} is missing; a task folder holds task.json and its images")
    value = read_json(path, TaskError)
    if not isinstance(value, dict):
        raise TaskError(f"{path}: expected an object with the keys 'format' and 'examples'")
    return value


def _check(ok: bool, path: Path, message: str, value: dict[str, Any] | None = None) -> None:
    if not ok:
        found = f", found {', '.join(map(repr, value))}" if value else ""
        raise TaskError(f"{path / 'task.json'}: {message}{found}")


def _example(path: Path, index: int, value: Any) -> Example:
    keys = {"scene", "goal_rgb", "goal_depth"}
    where = f"examples[{index}]"
    is_object = isinstance(value, dict)
    _check(is_object, path, f"{where}: expected an object with the keys {', '.join(sorted(keys))}")
    for key in sorted(keys - set(value)):
        _check(False, path, f"{where}: the key {key!r} is missing")
    for key in sorted(set(value) - keys):
        _check(False, path, f"{where}: unknown key {key!r}; known are {', '.join(sorted(keys))}")
    try:
        scene = Scene.from_json(value["scene"])
        world().validate(scene)
    except SceneError as error:
        raise TaskError(
            f"{path / 'task.json'}: {where}.scene: {error} (EVAPS_DOMAIN is {CHOSEN.name})"
        ) from None
    size = world().size
    rgb = _image(path, value["goal_rgb"], f"{where}.goal_rgb", (*size, 3))
    return Example(scene, RgbFrame(rgb, _image(path, value["goal_depth"], f"{where}.goal_depth", size)))


def _image(folder: Path, name: Any, where: str, shape: Sequence[int]) -> Image:
    _check(isinstance(name, str), folder, f"{where}: expected a file name, found {name!r}")
    path = folder / name
    inside = "\0" not in name and path.resolve().parent == folder.resolve()
    _check(inside, folder, f"{where}: {name!r} must lie in the task folder")
    try:
        with Picture.open(path, formats=("PNG",)) as picture:
            mode, pixels = picture.mode, np.array(picture)
    except FileNotFoundError:
        raise TaskError(f"{path} is missing; {folder / 'task.json'} names it as {where}") from None
    except (OSError, SyntaxError, ValueError, Picture.DecompressionBombError) as error:
        raise TaskError(f"{path} is not a PNG image that can be read: {error}") from None
    kind, wanted = ("colour", "RGB") if len(shape) == 3 else ("greyscale", "L")
    if mode != wanted or pixels.shape != tuple(shape):
        found = "x".join(map(str, reversed(pixels.shape[:2])))
        raise TaskError(
            f"{path} must be an 8-bit {kind} image of {shape[1]}x{shape[0]} pixels in mode {wanted}, "
            f"found {found} in mode {mode}"
        )
    return pixels
