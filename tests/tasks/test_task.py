"""Task folders: what is saved is loaded, and what is wrong is said in one line."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Picture

from evaps.robots.base import Pose, Scene, Thing
from evaps.robots.frames import RgbFrame, frame_match
from evaps.tasks.task import Example, Task, TaskError, load_task, save_task


def view(seed: int) -> RgbFrame:
    rng = np.random.default_rng(seed)
    return RgbFrame(rng.integers(0, 256, (120, 160, 3), np.uint8), rng.integers(0, 256, (120, 160), np.uint8))


@pytest.fixture(scope="module")
def task() -> Task:
    demon = Thing("Demon", -100, 300)
    scenes = [Scene(Pose(-300, 280 + i, 359 - i), (demon,) if i else ()) for i in range(5)]
    return Task("first", tuple(Example(scene, view(i)) for i, scene in enumerate(scenes)))


@pytest.fixture
def folder(task: Task, tmp_path: Path) -> Path:
    save_task(task, tmp_path / "first")
    return tmp_path / "first"


def test_what_is_saved_is_loaded(task: Task, folder: Path) -> None:
    loaded = load_task(folder)
    assert loaded.name == "first"
    assert [e.scene for e in loaded.examples] == [e.scene for e in task.examples]
    assert all(frame_match(a.goal, b.goal) for a, b in zip(loaded.examples, task.examples, strict=True))
    images = {f"goal{i}{depth}.png" for i in range(5) for depth in ("", "_depth")}
    assert {path.name for path in folder.iterdir()} == {"task.json"} | images


def test_a_folder_is_known_by_any_name(task: Task, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    assert load_task(".").name == "first"
    assert load_task(str(folder)).examples[0].scene == task.examples[0].scene


def test_nothing_is_overwritten(task: Task, folder: Path) -> None:
    before = (folder / "task.json").stat().st_mtime_ns
    with pytest.raises(TaskError, match="exists already; choose another folder or remove it"):
        save_task(task, folder)
    assert (folder / "task.json").stat().st_mtime_ns == before


def test_a_folder_is_complete_or_not_there(task: Task, tmp_path: Path) -> None:
    broken = Task("broken", (*task.examples[:4], Example(task.examples[4].scene, None)))  # type: ignore[arg-type]
    with pytest.raises(AttributeError):
        save_task(broken, tmp_path / "new")
    assert not list(tmp_path.iterdir())


def edit(change: Callable[[dict[str, Any]], object]) -> Callable[[Path], None]:
    """Break ``task.json``."""

    def apply(folder: Path) -> None:
        value = json.loads((folder / "task.json").read_text())
        change(value)
        (folder / "task.json").write_text(json.dumps(value))

    return apply


def picture(name: str, mode: str = "RGB", size: tuple[int, int] = (160, 120)) -> Callable[[Path], None]:
    """Put another picture in a place."""
    return lambda folder: Picture.new(mode, size).save(folder / name)


def example(**changes: Any) -> Callable[[Path], None]:
    """Change keys of the fourth example."""
    return edit(lambda value: value["examples"][3].update(changes))


def text(content: bytes) -> Callable[[Path], int]:
    """Replace ``task.json``."""
    return lambda folder: (folder / "task.json").write_bytes(content)


FAULTS: dict[str, tuple[Callable[[Path], Any], str]] = {
    "no task.json": (lambda f: (f / "task.json").unlink(), "task.json is missing; a task folder holds"),
    "not json": (text(b'{"format": 1,\n]'), "task.json is not JSON: line 2, column 1"),
    "not text": (text(b"\xff"), "task.json is not UTF-8 text: byte 0xff in line 1"),
    "a list": (text(b"[]"), "task.json: expected an object with the keys 'format' and 'examples'"),
    "no format": (edit(lambda v: v.pop("format")), "expected the keys 'format' and 'examples', found"),
    "unknown key": (edit(lambda v: v.update(gold="?")), "expected the keys .*, found .*'gold'"),
    "format 2": (edit(lambda v: v.update(format=2)), "format must be 1, not 2"),
    "four": (edit(lambda v: v["examples"].pop()), "examples must be a list of 5, found 4"),
    "no list": (edit(lambda v: v.update(examples={})), "examples must be a list of 5, found no list"),
    "no object": (edit(lambda v: v["examples"].__setitem__(3, 7)), r"examples\[3\]: expected an object with"),
    "no scene": (edit(lambda v: v["examples"][3].pop("scene")), r"examples\[3\]: the key 'scene' is missing"),
    "unknown in example": (example(state={}), r"examples\[3\]: unknown key 'state'; known are goal_depth"),
    "no such scene": (example(scene={}), r"examples\[3\].scene: a scene: the key 'robot' is missing"),
    "overlap": (
        edit(lambda v: v["examples"][3]["scene"]["things"].append({"kind": "Clip", "x": -100, "y": 300})),
        r"examples\[3\].scene: Demon at \(-100, 300\) and Clip at \(-100, 300\) overlap",
    ),
    "image missing": (
        lambda f: (f / "goal3.png").unlink(),
        r"goal3.png is missing; .* names it as examples\[3\]",
    ),
    "no name": (example(goal_rgb=3), r"examples\[3\].goal_rgb: expected a file name, found 3"),
    "empty name": (example(goal_rgb=""), r"examples\[3\].goal_rgb: '' must lie in the task folder"),
    "nul in name": (example(goal_rgb="a\0"), r"examples\[3\].goal_rgb: .* must lie in the task folder"),
    "name too long": (example(goal_rgb="a" * 300), "is not a PNG image that can be read"),
    "outside": (example(goal_depth="../x.png"), r"goal_depth: '../x.png' must lie in the task folder"),
    "absolute": (example(goal_depth="/etc/passwd"), r"goal_depth: '/etc/passwd' must lie in the task folder"),
    "link to outside": (
        lambda f: ((f / "goal3.png").unlink(), (f / "goal3.png").symlink_to("/etc/passwd")),
        "'goal3.png' must lie in the task folder",
    ),
    "a folder": (
        lambda f: ((f / "goal3.png").unlink(), (f / "goal3.png").mkdir()),
        "goal3.png is not a PNG image that can be read",
    ),
    "not an image": (
        lambda f: (f / "goal3.png").write_text("PNG"),
        "goal3.png is not a PNG image that can be",
    ),
    "cut off": (
        lambda f: (f / "goal3.png").write_bytes((f / "goal3.png").read_bytes()[:2000]),
        "goal3.png is not a PNG image that can be read",
    ),
    "size": (picture("goal3.png", size=(120, 160)), "160x120 pixels in mode RGB, found 120x160 in mode RGB"),
    "alpha": (picture("goal3.png", "RGBA"), "must be an 8-bit colour image .* found 160x120 in mode RGBA"),
    "grey": (picture("goal3.png", "L"), "must be an 8-bit colour image .* in mode L"),
    "colour depth": (picture("goal3_depth.png"), "must be an 8-bit greyscale image .* in mode RGB"),
    "palette depth": (picture("goal3_depth.png", "P"), "must be an 8-bit greyscale image .* in mode P"),
    "16 bit": (picture("goal3_depth.png", "I;16"), "must be an 8-bit greyscale image .* in mode I;16"),
    "1 bit": (picture("goal3_depth.png", "1"), "must be an 8-bit greyscale image .* in mode 1"),
}


@pytest.mark.parametrize(("break_it", "message"), FAULTS.values(), ids=FAULTS)
def test_a_fault_is_one_clear_line(folder: Path, break_it: Callable[[Path], Any], message: str) -> None:
    break_it(folder)
    with pytest.raises(TaskError, match=message) as error:
        load_task(folder)
    assert "\n" not in str(error.value)
    assert str(folder) in str(error.value)


def test_what_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for name in ("none", "file"):
        with pytest.raises(TaskError, match=f"{name}/task.json is missing") as error:
            load_task(tmp_path / name)
        assert "\n" not in str(error.value)
