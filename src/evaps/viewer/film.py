"""A run as a film: the map, what the robot saw, which line it was at, and what it perceived there."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image as Picture
from PIL import ImageDraw, ImageFont

from evaps.dsl import Program, Trace, UserError, run
from evaps.dsl.sampler import PERCEPTION_KEYS, PERCEPTIONS
from evaps.files import write_atomically
from evaps.robots.base import Robot, Scene, ThingState, WorldState
from evaps.robots.frames import Observation
from evaps.robots.world import world

WIDTH = 320  # pixels of the robot's view, and of the map
CODE = 320  # pixels of the column with the program
MARGIN = 12
FEW = 12  # things that are named on the map
LINE = 18
SECONDS = 0.8  # that each moment of a GIF is shown
INK, PAPER, MARK, FAINT = (32, 32, 40), (250, 250, 248), (255, 228, 140), (140, 140, 150)
GRID, BLOCK, BEYOND = (214, 214, 206), (130, 74, 46), (150, 150, 156)
ROBOT, ALIVE, DEAD = (30, 90, 200), (200, 60, 40), (170, 170, 170)


@dataclass(frozen=True)
class Moment:
    """What is shown at a time.

    Attributes:
        view: what the robot saw.
        state: the world, for the map.
        perceived: the perceptions that were true.
        segments: the segments of the program that were at work then: conditions asked and the action done.
    """

    view: Observation
    state: WorldState
    perceived: tuple[str, ...]
    segments: frozenset[int]


def look(robot: Robot) -> Moment:
    """What is to be seen of a robot as it stands."""
    perceived = tuple(key for key in PERCEPTION_KEYS if robot.perceive(key))
    return Moment(robot.observe(), robot.state(), perceived, frozenset())


class _Witness:
    """A robot whose every view, state and perception is kept."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.seen = [look(robot)]

    def act(self, action: str) -> None:
        self.robot.act(action)
        self.seen.append(look(self.robot))

    def perceive(self, perception: str) -> bool:
        return self.robot.perceive(perception)

    def observe(self) -> Observation:
        return self.seen[-1].view


def record(program: Program, scene: Scene, robot: Robot) -> tuple[Trace[Observation], list[Moment]]:
    """Run a program from a scene, and what is to be seen of it."""
    robot.reset(scene)
    witness = _Witness(robot)
    trace = run(program, witness)
    busy: list[set[int]] = [set() for _ in witness.seen]
    for event in trace.events:
        busy[event.time].add(event.segment)
    moments = [replace(seen, segments=frozenset(at)) for seen, at in zip(witness.seen, busy, strict=True)]
    return trace, moments


def save_film(path: Path, trace: Trace[Observation], scene: Scene, moments: Sequence[Moment]) -> None:
    """Write a GIF that plays, or a PNG in which the moments stand in rows.

    Raises:
        UserError: the name ends in neither ``.gif`` nor ``.png``.
    """
    check_film(path)
    pictures = [draw(trace, scene, moments, time) for time in range(len(moments))]
    out = BytesIO()
    if path.suffix.lower() == ".gif":
        rest: dict[str, Any] = dict(append_images=pictures[1:], save_all=True, loop=0)
        pictures[0].save(out, "GIF", duration=round(1000 * SECONDS), **rest)
    else:
        _strip(pictures).save(out, "PNG", optimize=True)
    write_atomically(path, out.getvalue())


def check_film(path: Path) -> None:
    """Whether a film can have that name.

    Raises:
        UserError: it ends in neither ``.gif`` nor ``.png``.
    """
    if path.suffix.lower() not in (".gif", ".png"):
        raise UserError(f"a film must end in .gif or .png, not {path.name!r}")


def _view_size() -> tuple[int, int]:
    height, width = world().size
    return WIDTH, WIDTH * height // width


def _map_size() -> tuple[int, int]:
    (west, east), (south, north) = world().x, world().y
    return WIDTH, round(WIDTH * (north - south) / (east - west))


def _strip(pictures: Sequence[Picture.Image]) -> Picture.Image:
    """All of them, row after row, so that the whole is about as wide as high."""
    width, height = pictures[0].size
    columns = max(1, round(math.sqrt(len(pictures) * height / width)))
    strip = Picture.new("RGB", (width * columns, height * -(-len(pictures) // columns)), PAPER)
    for number, picture in enumerate(pictures):
        row, column = divmod(number, columns)
        strip.paste(picture, (column * width, row * height))
    return strip


def draw(trace: Trace[Observation], scene: Scene, moments: Sequence[Moment], time: int) -> Picture.Image:
    """The picture of one moment: view, map, program and perceptions."""
    moment = moments[time]
    view = _view_size()
    left, right = MARGIN, 2 * MARGIN + WIDTH
    top, middle = MARGIN + LINE, 2 * MARGIN + LINE + view[1]
    program = trace.program
    lines = len(program.python_lines) + len(PERCEPTION_KEYS) + 3
    height = max(middle + _map_size()[1] + MARGIN, top + lines * LINE + MARGIN)
    picture = Picture.new("RGB", (right + CODE + MARGIN, height), PAPER)
    pen = ImageDraw.Draw(picture)
    said = f"after {time} of {len(moments) - 1} actions"
    if time == len(moments) - 1 and not trace.halted:
        said += ": stopped there, too many steps"
    pen.text((left, MARGIN - 4), said, INK, _font())
    picture.paste(Picture.fromarray(moment.view.rgb).resize(view, Picture.Resampling.NEAREST), (left, top))
    picture.paste(_map(scene, [m.state for m in moments[: time + 1]]), (left, middle))
    _write(pen, program, moment, (right, top))
    return picture


def _write(pen: ImageDraw.ImageDraw, program: Program, moment: Moment, at: tuple[int, int]) -> None:
    """The program, with the lines that are at work marked, and the perceptions, with the true ones black."""
    x, y = at
    begun: set[int] = set()
    for segment, text in program.python_lines:
        if segment in moment.segments and segment not in begun:  # an else: is no work of its own
            pen.rectangle((x - 4, y - 1, x + CODE - 8, y + LINE - 3), fill=MARK)
        begun.add(segment)
        pen.text((x, y), text, INK, _font())
        y += LINE
    y += LINE
    for perception in PERCEPTIONS:
        true = perception.key in moment.perceived
        pen.text((x, y), f"{'yes' if true else 'no':4} {perception.python}", INK if true else FAINT, _font())
        y += LINE


def _map(scene: Scene, states: Sequence[WorldState]) -> Picture.Image:
    """The arena from above, north up: the robot, the way that it came, the things, and what stays."""
    width, height = _map_size()
    picture = Picture.new("RGB", (width, height), (236, 236, 230))
    pen = ImageDraw.Draw(picture)
    pen.rectangle((0, 0, width - 1, height - 1), outline=INK)
    _draw_grid(pen)
    _draw_fixed(pen, scene)
    way = [_place(state.robot.x, state.robot.y) for state in states]
    if len(way) > 1:
        pen.line(way, fill=ROBOT, width=1)
    _draw_things(pen, Counter(states[-1].things))
    x, y = way[-1]
    heading = np.deg2rad(states[-1].robot.heading)
    tip = (x + 16 * math.cos(heading), y - 16 * math.sin(heading))
    pen.ellipse((x - 6, y - 6, x + 6, y + 6), fill=ROBOT)
    pen.line([(x, y), tip], fill=ROBOT, width=3)
    return picture


def _draw_things(pen: ImageDraw.ImageDraw, things: Mapping[ThingState, int]) -> None:
    """A disc for each, with its name beside it if there is room; on it how many there are in one place."""
    named = sum(things.values()) <= FEW and not world().grid  # else names would cover one another
    for thing, number in things.items():
        x, y = _place(thing.x, thing.y)
        color = ALIVE if thing.alive else DEAD
        pen.ellipse((x - 6, y - 6, x + 6, y + 6), fill=color)
        if number > 1:
            pen.text((x, y), str(number), PAPER, _font(), anchor="mm")
        if named:
            right = x + 8 + pen.textlength(thing.kind, _font())
            beside = (x + 8, "lm") if right < _map_size()[0] else (x - 8, "rm")
            pen.text((beside[0], y), thing.kind, color, _font(), anchor=beside[1])


def _draw_grid(pen: ImageDraw.ImageDraw) -> None:
    (west, east), (south, north) = world().x, world().y
    for n in range(1, round((east - west) / world().grid) if world().grid else 0):
        x, _ = _place(west + n * world().grid, south)
        pen.line((x, 0, x, _map_size()[1]), fill=GRID)
    for n in range(1, round((north - south) / world().grid) if world().grid else 0):
        _, y = _place(west, south + n * world().grid)
        pen.line((0, y, WIDTH, y), fill=GRID)


def _draw_fixed(pen: ImageDraw.ImageDraw, scene: Scene) -> None:
    """What lies beyond the scene, and its blocks: they are in no state, since they stay as they are."""
    width, height = _map_size()
    for end in scene.things:
        if end.kind == world().border:
            x, y = _place(end.x - world().grid / 2, end.y - world().grid / 2)
            pen.rectangle((x, 0, width, height), fill=BEYOND)
            pen.rectangle((0, 0, width, y), fill=BEYOND)
    for block in scene.things:
        if block.kind in world().blocks:
            half = world().radii[block.kind]
            corners = _place(block.x - half, block.y + half), _place(block.x + half, block.y - half)
            pen.rectangle(corners, fill=BLOCK)


def _place(x: float, y: float) -> tuple[float, float]:
    (west, east), (south, north) = world().x, world().y
    across, down = (x - west) / (east - west), (north - y) / (north - south)
    width, height = _map_size()
    return across * width, down * height


def _font() -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size=13)
