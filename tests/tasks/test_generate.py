"""Random tasks: reproducible one by one, and what every one of them promises."""

import hashlib
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evaps.dsl import Program, covered, run
from evaps.dsl.sampler import SamplerConfig
from evaps.robots.base import Pose, Scene, Thing
from evaps.robots.frames import Observation, frame_match
from evaps.robots.memo import MemoRobot
from evaps.robots.scenes import random_scene, validate
from evaps.tasks.generate import Draft, draft_task, generate_task
from evaps.tasks.questions import OpenProgram

EVAPS = str(Path(sys.executable).with_name("evaps"))
SEED, COUNT = 3, 12


def contents(draft: Draft) -> tuple[Any, ...]:
    """All of a draft as plain values."""
    views = [view.rgb.tobytes() + view.depth.tobytes() for view in (*draft.first, *draft.last)]
    return draft.program, draft.scenes, draft.states, draft.actions, views


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


@pytest.fixture(scope="module")
def drafts(robot: MemoRobot) -> list[Draft]:
    return [generate_task(SEED, index, robot, SamplerConfig()) for index in range(COUNT)]


@pytest.mark.parametrize("index", [COUNT - 1, 3, 0])
def test_a_task_depends_on_its_seed_and_index_alone(
    robot: MemoRobot, drafts: list[Draft], index: int
) -> None:
    again = generate_task(SEED, index, robot, SamplerConfig())
    assert contents(again) == contents(drafts[index])


def test_other_seeds_and_indices_are_other_tasks(robot: MemoRobot, drafts: list[Draft]) -> None:
    other = generate_task(SEED + 1, 0, robot, SamplerConfig())
    assert other.scenes != drafts[0].scenes
    assert len({draft.scenes for draft in drafts}) == COUNT


def test_every_task_keeps_its_promises(robot: MemoRobot, drafts: list[Draft]) -> None:
    for draft in drafts:
        assert len(draft.program.tokens) <= 32
        assert len(set(draft.scenes)) == 6
        traces = []
        for i, scene in enumerate(draft.scenes):
            validate(scene)
            robot.reset(scene)
            traces.append(run(draft.program, robot))
            assert traces[i].halted
            assert traces[i].actions == draft.actions[i]
            assert robot.state() == draft.states[i]
            assert frame_match(traces[i].observations[0], draft.first[i])
            assert frame_match(traces[i].observations[-1], draft.last[i])
        assert covered(draft.program, traces[:5])
        assert draft.steps == max(len(trace.actions) for trace in traces) >= 2


def test_the_drafts_are_not_all_alike(drafts: list[Draft]) -> None:
    text = " ".join(str(draft.program) for draft in drafts)
    assert {"IF", "WHILE", "not", "ATTACK", "TURN_LEFT", "MOVE_FORWARD"} <= set(text.split())
    assert len({draft.steps for draft in drafts}) >= 3


def test_the_configuration_is_obeyed(robot: MemoRobot) -> None:
    straight = SamplerConfig(max_tokens=8, conditionals=(1.0,), repeat=0.0)
    for index in range(3):
        draft = generate_task(SEED, index, robot, straight)
        assert len(draft.program.tokens) <= 8
        assert len(set(draft.actions)) == 1, "without a condition it does the same everywhere"


def closed(program: Program) -> OpenProgram:
    return OpenProgram(program, is_open=False)


def test_scenes_that_show_only_one_side_of_a_condition_do_not_do(
    robot: MemoRobot, drafts: list[Draft], rng: np.random.Generator
) -> None:
    draft = next(d for d in drafts if "IF" in str(d.program).split() or "IFELSE" in str(d.program).split())
    robot.forget()
    again = draft_task(closed(draft.program), draft.scenes, robot, rng)
    assert again is not None
    assert again.program == draft.program
    assert set(again.scenes) == set(draft.scenes)
    assert draft_task(closed(draft.program), draft.scenes[:5], robot, rng) is None, "six are needed"
    assert draft_task(closed(draft.program), [draft.scenes[0]] * 10, robot, rng) is None


def test_no_run_takes_more_actions_than_it_may(robot: MemoRobot, rng: np.random.Generator) -> None:
    scenes = [random_scene(rng) for _ in range(8)]
    program = Program.parse("DEF run m( TURN_LEFT TURN_LEFT TURN_LEFT m)")
    assert draft_task(closed(program), scenes, robot, rng, most=2) is None
    draft = draft_task(closed(program), scenes, robot, rng, most=3)
    assert draft is not None
    assert draft.steps == 3


def test_conditions_ask_what_the_scenes_tell_apart(robot: MemoRobot, rng: np.random.Generator) -> None:
    """Three scenes show a demon and three show none; nothing else is in them: so it asks for a demon."""
    places = [(-200, 300), (-150, 280), (-100, 300)]
    scenes = [Scene(Pose(-300, 280, 0), (Thing("Demon", *place),)) for place in places]
    scenes += [Scene(Pose(-300, y, 0)) for y in (200, 280, 360)]
    asked = set()
    for _ in range(8):
        robot.forget()
        program = Program.parse("DEF run m( TURN_LEFT IF c( ISTHERE Revenant c) i( ATTACK i) m)")
        draft = draft_task(OpenProgram(program), scenes, robot, rng)
        assert draft is not None
        asked |= set(str(draft.program).split()) & {"Demon", "HellKnight", "Revenant"}
        assert draft.steps == 2
    assert asked == {"Demon"}


def test_a_loop_that_waits_for_what_is_not_there_is_not_run(
    robot: MemoRobot, rng: np.random.Generator
) -> None:
    program = Program.parse("DEF run m( WHILE c( not c( ISTHERE Demon c) c) w( TURN_LEFT w) m)")
    scenes = [Scene(Pose(-300, y, 0)) for y in range(200, 360, 20)]
    simulated = robot.simulated_actions
    assert draft_task(closed(program), scenes, robot, rng) is None
    assert robot.simulated_actions == simulated


def sums(view: Observation, prefix: str = "") -> dict[str, str]:
    planes = {"rgb": view.rgb, "depth": view.depth}
    return {f"{prefix}{key}_sha256": hashlib.sha256(p.tobytes()).hexdigest() for key, p in planes.items()}


@pytest.mark.parametrize(("index", "example"), [(0, 0), (5, 3), (9, 5)])
def test_the_command_line_comes_to_the_same_end(
    drafts: list[Draft], tmp_path: Path, index: int, example: int
) -> None:
    draft = drafts[index]
    (tmp_path / "scene.json").write_text(json.dumps(draft.scenes[example].to_json()))
    command = [EVAPS, "run", "--program", "-", "--scene", "scene.json", "--json"]
    text = draft.program.to_python()
    done = subprocess.run(command, cwd=tmp_path, input=text, capture_output=True, text=True, timeout=240)
    assert json.loads(done.stdout) == {
        "halted": True,
        "actions": list(draft.actions[example]),
        "final": draft.states[example].to_json(),
        **sums(draft.last[example]),
        **sums(draft.first[example], "first_"),
    }
