"""Films show what a run's moments were."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture

from evaps.dsl import Program, UserError, run
from evaps.robots.base import Pose, Scene, Thing
from evaps.robots.memo import MemoRobot
from evaps.viewer.film import MARGIN, MARK, WIDTH, draw, record, save_film

PROGRAM = Program.parse(
    "DEF run m( IF c( ISTHERE Demon c) i( MOVE_LEFT i) "
    "WHILE c( not c( INTARGET Demon c) c) w( TURN_LEFT w) m)"
)
SCENE = Scene(Pose(-300, 240, 0), (Thing("Demon", -100, 400),))


def test_moments_are_those_of_the_run(robot: MemoRobot) -> None:
    trace, moments = record(PROGRAM, SCENE, robot)
    robot.reset(SCENE)
    again = run(PROGRAM, robot)
    assert trace.actions == again.actions
    assert len(moments) == len(trace.actions) + 1
    for moment, view in zip(moments, again.observations, strict=True):
        assert np.array_equal(moment.view.rgb, view.rgb)
    assert moments[0].segments == {1, 2}, "the condition, and the step to the left"
    assert 3 in moments[1].segments
    assert moments[-1].state == robot.state()


@pytest.mark.parametrize("name", ["film.gif", "film.png"])
def test_every_moment_is_in_the_film(robot: MemoRobot, tmp_path: Path, name: str) -> None:
    trace, moments = record(PROGRAM, SCENE, robot)
    save_film(tmp_path / name, trace, SCENE, moments)
    with Picture.open(tmp_path / name) as film:
        if name.endswith("gif"):
            assert film.n_frames == len(moments)  # type: ignore[attr-defined]
            film.seek(len(moments) - 1)
            first = film.convert("RGB")
        else:
            width, height = draw(trace, SCENE, moments, 0).size
            assert film.width * film.height >= width * height * len(moments)
            assert film.width < 2 * film.height < 4 * film.width
            first = film.convert("RGB").crop((0, 0, width, height))
    shown = np.asarray(first)
    assert (shown == MARK).all(-1).any(), "a line is marked"
    if name.endswith("png"):
        view = shown[MARGIN + 18 : MARGIN + 18 + 240 : 2, MARGIN : MARGIN + WIDTH : 2]
        assert np.array_equal(view, moments[0].view.rgb)


def test_other_names_are_told(robot: MemoRobot, tmp_path: Path) -> None:
    trace, moments = record(PROGRAM, SCENE, robot)
    with pytest.raises(UserError, match=r"must end in \.gif or \.png"):
        save_film(tmp_path / "film.mp4", trace, SCENE, moments)
    save_film(tmp_path / "film.GIF", trace, SCENE, moments[:1])


def test_a_run_that_does_not_halt_says_so_at_its_end(robot: MemoRobot) -> None:
    endless = Program.parse("DEF run m( WHILE c( ISTHERE Demon c) w( MOVE_LEFT MOVE_RIGHT w) m)")
    trace, moments = record(endless, SCENE, robot)
    assert not trace.halted
    cut = [*moments[:2]]
    halted = replace(trace, halted=True)
    assert draw(trace, SCENE, cut, 0).tobytes() == draw(halted, SCENE, cut, 0).tobytes()
    assert draw(trace, SCENE, cut, 1).tobytes() != draw(halted, SCENE, cut, 1).tobytes()
