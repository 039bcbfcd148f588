"""Random tasks: reproducible one by one, and what every one of them promises."""

import hashlib
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from evaps.dsl import covered, run
from evaps.dsl.sampler import SamplerConfig
from evaps.robots.frames import Observation, frame_match
from evaps.robots.memo import MemoRobot
from evaps.robots.scenes import validate
from evaps.tasks.generate import Draft, choose_scenes, generate_task

EVAPS = str(Path(sys.executable).with_name("evaps"))
SEED, COUNT = 3, 12


def contents(draft: Draft) -> tuple[Any, ...]:
    """All of a draft as plain values."""
    views = [view.rgb.tobytes() + view.depth.tobytes() for view in (*draft.first, *draft.last)]
    return draft.program, draft.scenes, draft.states, draft.actions, views


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


def test_scenes_that_show_only_one_side_of_a_condition_do_not_do(
    robot: MemoRobot, drafts: list[Draft]
) -> None:
    draft = next(d for d in drafts if "IF" in str(d.program).split() or "IFELSE" in str(d.program).split())
    robot.forget()
    assert choose_scenes(draft.program, draft.scenes, robot) is not None
    assert choose_scenes(draft.program, draft.scenes[:5], robot) is None, "six are needed"
    one = [draft.scenes[0]] * 10
    assert choose_scenes(draft.program, one, robot) is None


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
