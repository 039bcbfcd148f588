"""What the page sends and is sent: JSON on the one side, tasks, programs and runs on the other."""

from __future__ import annotations

import base64
import binascii
import re
from io import BytesIO
from typing import Any

import numpy as np
from PIL import Image as Picture
from pydantic import BaseModel, ConfigDict, Field, field_validator

from evaps.domain import CHOSEN
from evaps.dsl import Program, ProgramError, Trace, UserError
from evaps.robots.base import Robot, Scene
from evaps.robots.frames import Image, Observation, RgbFrame
from evaps.robots.world import world
from evaps.tasks.task import EXAMPLES, Example, Task
from evaps.viewer.film import Moment, record
from evaps.viewer.pictures import PNG_URI, data_uri, depth_png, rgb_png

MOST_TEXT = 10_000  # characters of a program
MOST_PICTURE = 200_000  # characters of a picture


class Form(BaseModel):
    """What is sent has these keys and no others."""

    model_config = ConfigDict(extra="forbid")


class ProgramForm(Form):
    """A program as somebody writes it."""

    program: str = Field(max_length=MOST_TEXT)


class RunForm(Form):
    """A scene, and a program to run from it; without one the first view is all that is to be seen."""

    scene: dict[str, Any]
    program: str | None = Field(None, max_length=MOST_TEXT)


class ExampleForm(Form):
    """A scene, and what the robot should see in the end: as two pictures, or as the end of a program."""

    scene: dict[str, Any]
    program: str | None = Field(None, max_length=MOST_TEXT)
    goal_rgb: str | None = Field(None, max_length=MOST_PICTURE)
    goal_depth: str | None = Field(None, max_length=MOST_PICTURE)


class TaskForm(Form):
    """Five examples."""

    name: str = "task"
    examples: list[ExampleForm] = Field(min_length=EXAMPLES, max_length=EXAMPLES)

    @field_validator("name")
    @classmethod
    def _can_be_a_folder(cls, name: str) -> str:
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9 _-]{0,59}", name):
            raise ValueError(
                "begin with a letter or digit; at most 60 letters, digits, spaces, hyphens and underscores"
            )
        return name


class SynthesisForm(TaskForm):
    """A task, who is to solve it, and for how much."""

    method: str = Field("verified", max_length=60)
    seconds: float = Field(8.0, gt=0, le=600)
    actions: int = Field(CHOSEN.budget, ge=1, le=100_000)


def read_scene(value: dict[str, Any]) -> Scene:
    """A valid scene.

    Raises:
        UserError: it is not one; the message says why.
    """
    scene = Scene.from_json(value)
    world().validate(scene)
    return scene


def read_task(form: TaskForm, robot: Robot) -> Task:
    """The task; the goals that are given as programs are run on the robot.

    Raises:
        UserError: something in it is wrong; the message says which example.
    """
    examples = []
    for number, example in enumerate(form.examples, 1):
        try:
            scene = read_scene(example.scene)
            examples.append(Example(scene, _goal(example, scene, robot)))
        except UserError as error:
            raise UserError(f"example {number}: {error}") from error
    return Task(form.name, tuple(examples))


def _goal(form: ExampleForm, scene: Scene, robot: Robot) -> Observation:
    if form.program is not None:
        trace, moments = record(Program.parse(form.program), scene, robot)
        if not trace.halted:
            raise UserError("the program does not come to an end within its limits")
        return moments[-1].view
    if form.goal_rgb is None or form.goal_depth is None:
        raise UserError("it has no goal: record a run, or run a program")
    size = world().size
    rgb = _pixels(form.goal_rgb, "RGB", (*size, 3))
    return RgbFrame(rgb, _pixels(form.goal_depth, "L", size))


def _pixels(uri: str, mode: str, shape: tuple[int, ...]) -> Image:
    try:
        file = BytesIO(base64.b64decode(uri.removeprefix(PNG_URI), validate=True))
        with Picture.open(file, formats=("PNG",)) as picture:
            if picture.size != (shape[1], shape[0]):
                raise ValueError(picture.size)
            pixels = np.array(picture.convert(mode))
    except (binascii.Error, OSError, SyntaxError, ValueError, Picture.DecompressionBombError):
        pixels = np.zeros(0, np.uint8)
    if pixels.shape != shape:
        raise UserError(f"the goal is not a PNG picture of {shape[1]} x {shape[0]} pixels")
    return pixels


def program_json(text: str) -> dict[str, Any]:
    """A program in both forms, or where it goes wrong: ``{"error": {"line", "column", "message"}}``."""
    try:
        program = Program.parse(text)
    except ProgramError as error:
        return {"error": {"line": error.line, "column": error.column, "message": str(error)}}
    return {"python": program.to_python(), "tokens": str(program)}


def run_json(program: Program, trace: Trace[Observation], moments: list[Moment]) -> dict[str, Any]:
    """A run, moment by moment, with the lines that were at work in each."""
    first = {segment: line for line, (segment, _) in reversed([*enumerate(program.python_lines)])}
    return {
        "halted": trace.halted,
        "actions": list(trace.actions),
        "python": program.to_python(),
        "moments": [{**moment_json(m), "lines": sorted(first[s] for s in m.segments)} for m in moments],
    }


def moment_json(moment: Moment) -> dict[str, Any]:
    """What is seen, perceived, and, for the map, where everything is."""
    return {
        **view_json(moment.view),
        "perceived": list(moment.perceived),
        "state": moment.state.to_json(),
    }


def view_json(view: Observation) -> dict[str, str]:
    """Colours and depth as PNGs in data URIs; depth is exact, and dark where it is near."""
    return {"rgb": data_uri(rgb_png(view.rgb)), "depth": data_uri(depth_png(view.depth, 255))}


def task_json(task: Task) -> dict[str, Any]:
    """A task as `TaskForm` takes it."""
    return {"name": task.name, "examples": [example_json(example) for example in task.examples]}


def example_json(example: Example) -> dict[str, Any]:
    """An example whose goal is given as pictures, such as `ExampleForm` takes."""
    seen = view_json(example.goal)
    return {"scene": example.scene.to_json(), "goal_rgb": seen["rgb"], "goal_depth": seen["depth"]}
