"""The robot that remembers: the same as the plain one, whatever ran before, and nothing twice."""

import os
import signal
from collections.abc import Iterator

import numpy as np
import pytest

from evaps.dsl import Program, Trace, run
from evaps.dsl.sampler import PERCEPTION_KEYS, sample_program
from evaps.robots.base import Pose, Scene, Thing
from evaps.robots.doom import DoomRobot
from evaps.robots.frames import Observation, frame_match
from evaps.robots.memo import MemoRobot, Unsimulated
from evaps.robots.scenes import random_scene

SCENE = Scene(Pose(-300, 280, 0), (Thing("Demon", -100, 300),))
OTHER = Scene(Pose(-200, 200, 90), (Thing("Revenant", -200, 400),))


@pytest.fixture
def memo(robot: DoomRobot) -> MemoRobot:
    """A new memory on the file's engine."""
    return MemoRobot(robot, PERCEPTION_KEYS)


@pytest.fixture(scope="module")
def plain() -> Iterator[DoomRobot]:
    """A second engine, without a memory."""
    robot = DoomRobot()
    yield robot
    robot.close()


def programs(count: int, seed: int = 0) -> list[Program]:
    rng = np.random.default_rng(seed)
    return [sample_program(rng) for _ in range(count)]


def scenes(count: int) -> list[Scene]:
    return [random_scene(np.random.default_rng(seed)) for seed in range(count)]


def assert_same(a: Trace[Observation], b: Trace[Observation]) -> None:
    assert a.events == b.events
    assert a.halted == b.halted
    assert len(a.observations) == len(b.observations)
    assert all(map(frame_match, a.observations, b.observations))


def test_random_programs_do_what_they_do_on_the_plain_robot(memo: MemoRobot, plain: DoomRobot) -> None:
    actions = 0
    for scene in scenes(4):
        for program in programs(20):
            memo.reset(scene)
            plain.reset(scene)
            trace = run(program, plain)
            assert_same(run(program, memo), trace)
            assert memo.state() == plain.state()
            assert {p for p in PERCEPTION_KEYS if memo.perceive(p)} == {
                p for p in PERCEPTION_KEYS if plain.perceive(p)
            }
            actions += len(trace.actions)
    assert actions > 200


def test_scenes_in_turns_do_not_disturb_one_another(memo: MemoRobot, plain: DoomRobot) -> None:
    rng = np.random.default_rng(1)
    starts, paths = scenes(3), {i: [] for i in range(3)}  # type: dict[int, list[str]]
    for _ in range(30):
        i = int(rng.integers(3))
        paths[i].append(str(rng.choice(["MOVE_FORWARD", "MOVE_LEFT", "TURN_LEFT", "ATTACK"])))
        memo.reset(starts[i])
        for action in paths[i]:
            memo.act(action)
    for i, path in paths.items():
        memo.reset(starts[i])
        plain.reset(starts[i])
        for action in path:
            memo.act(action)
            plain.act(action)
            assert frame_match(memo.observe(), plain.observe())
            assert memo.state() == plain.state()


def test_a_known_path_simulates_nothing(memo: MemoRobot, monkeypatch: pytest.MonkeyPatch) -> None:
    path = ["TURN_LEFT", "ATTACK", "MOVE_FORWARD"]
    memo.reset(SCENE)
    for action in path:
        memo.act(action)
    last = memo.observe()
    calls: list[str] = []
    for name in ("reset", "act", "observe", "perceive", "state", "fingerprint"):
        monkeypatch.setattr(memo.robot, name, lambda *_, name=name: calls.append(name))
    memo.reset(SCENE)
    for action in path:
        memo.act(action)
    assert memo.observe() is last
    assert (last.rgb.shape, last.depth.shape) == ((120, 160, 3), (120, 160))
    assert not memo.perceive("ISTHERE Demon")
    assert (memo.state().ammo, memo.simulated_actions, calls) == (49, 3, [])


def test_the_counter_counts_replays_too(memo: MemoRobot) -> None:
    def walk(scene: Scene, *actions: str) -> int:
        memo.reset(scene)
        for action in actions:
            memo.act(action)
        return memo.simulated_actions

    assert walk(SCENE, "TURN_LEFT", "ATTACK") == 2
    assert walk(SCENE, "TURN_LEFT", "ATTACK") == 2, "known"
    assert walk(SCENE, "TURN_LEFT", "ATTACK", "MOVE_LEFT") == 3, "the robot still stands there"
    assert walk(SCENE, "TURN_LEFT", "MOVE_LEFT") == 5, "from the start again: one replayed, one new"
    assert walk(OTHER, "ATTACK") == 6
    assert walk(SCENE, "TURN_LEFT", "MOVE_LEFT", "ATTACK") == 9, "two replayed, one new"
    memo.forget()
    assert walk(OTHER, "ATTACK") == 10


def test_what_is_forgotten_is_simulated_again_and_equal(memo: MemoRobot) -> None:
    memo.reset(SCENE)
    memo.act("ATTACK")
    before = memo.observe()
    memo.forget()
    with pytest.raises(ValueError, match="call reset"):
        memo.observe()
    memo.reset(SCENE)
    memo.act("ATTACK")
    assert memo.observe() is not before
    assert frame_match(memo.observe(), before)


def test_a_dead_engine_changes_nothing_but_the_time(plain: DoomRobot) -> None:
    memo = MemoRobot(DoomRobot(), PERCEPTION_KEYS)
    path = ["TURN_LEFT", "MOVE_FORWARD", "ATTACK", "MOVE_LEFT"]
    memo.reset(SCENE)
    for action in path[:2]:
        memo.act(action)
    assert isinstance(memo.robot, DoomRobot)
    assert memo.robot._engine is not None
    os.kill(memo.robot._engine.pid or 0, signal.SIGKILL)
    for action in path[2:]:
        memo.act(action)
    assert memo.simulated_actions == 4, "what was lost is not counted twice"
    plain.reset(SCENE)
    for action in path:
        plain.act(action)
    assert frame_match(memo.observe(), plain.observe())
    assert memo.state() == plain.state()
    memo.close()


def walk(memo: MemoRobot, *actions: str, scene: Scene = SCENE) -> int:
    """How many actions were simulated when the robot has walked."""
    memo.reset(scene)
    for action in actions:
        memo.act(action)
    return memo.simulated_actions


def test_places_that_nothing_can_tell_apart_are_one(memo: MemoRobot) -> None:
    assert walk(memo, "MOVE_FORWARD", "MOVE_LEFT") == 2
    first = memo.node
    assert walk(memo, "MOVE_LEFT", "MOVE_FORWARD") == 4
    assert memo.node is first
    assert walk(memo, "MOVE_LEFT", "MOVE_FORWARD", "ATTACK") == 5, "the robot stands there"
    assert walk(memo, "MOVE_FORWARD", "MOVE_LEFT", "ATTACK") == 5, "known from the other way"
    root = walk(memo) and memo.node
    assert walk(memo, "TURN_LEFT", "TURN_RIGHT") == 7
    assert memo.node is root
    assert walk(memo, "TURN_LEFT", "TURN_RIGHT", "MOVE_LEFT", "MOVE_FORWARD", "ATTACK") == 7
    assert memo.node.actions == ("MOVE_FORWARD", "MOVE_LEFT", "ATTACK"), "of the ways there a shortest one"


def test_a_robot_without_fingerprints_merges_nothing(
    memo: MemoRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memo.robot, "fingerprint", lambda: None)
    walk(memo, "MOVE_FORWARD", "MOVE_LEFT")
    first = memo.node
    walk(memo, "MOVE_LEFT", "MOVE_FORWARD")
    assert memo.node is not first
    assert frame_match(memo.observe(), first.view)


@pytest.mark.parametrize("eager", [True, False])
def test_a_small_budget_changes_nothing_but_the_work(robot: DoomRobot, plain: DoomRobot, eager: bool) -> None:
    frame = 2 * 120 * 160  # bytes
    memo = MemoRobot(robot, PERCEPTION_KEYS, eager, budget=8 * frame)
    traces = []
    for scene in scenes(3):
        for program in programs(6):
            memo.reset(scene)
            traces.append((scene, run(program, memo)))
            assert memo.frames.size <= 8 * frame
    simulated = memo.simulated_actions
    for scene, trace in traces:
        plain.reset(scene)
        expected = run(trace.program, plain)
        assert_same(trace, expected)
        for remembered, seen in zip(trace.observations, expected.observations, strict=True):
            assert np.array_equal(remembered.rgb, seen.rgb)
            assert np.array_equal(remembered.depth, seen.depth)
    assert memo.frames.size <= 8 * frame
    assert memo.simulated_actions > simulated, "some frames had to be simulated again"


def test_who_does_not_look_pays_for_looks_alone(robot: DoomRobot, monkeypatch: pytest.MonkeyPatch) -> None:
    lazy = MemoRobot(robot, PERCEPTION_KEYS, eager=False)
    rendered = []
    render = robot._render
    monkeypatch.setattr(robot, "_render", lambda game: rendered.append(1) or render(game))
    walk(lazy, "TURN_LEFT", "MOVE_FORWARD", "TURN_LEFT")
    assert not rendered
    lazy.perceive("ISTHERE Demon"), lazy.state(), lazy.observe().digest, lazy.observe().rgb
    assert (len(rendered), lazy.simulated_actions) == (1, 3)
    walk(lazy, "TURN_LEFT")
    assert lazy.observe().depth.shape == (120, 160)
    assert (len(rendered), lazy.simulated_actions) == (2, 4), "it had gone on: back to it from the start"


def test_places_merge_where_they_are_looked_at(robot: DoomRobot) -> None:
    lazy = MemoRobot(robot, PERCEPTION_KEYS, eager=False)
    walk(lazy)
    lazy.state()
    assert walk(lazy, "TURN_LEFT", "TURN_RIGHT") == 2
    lazy.state()
    assert walk(lazy, "TURN_LEFT", "TURN_RIGHT", "TURN_LEFT", "TURN_RIGHT") == 2


def test_what_is_not_known_is_not_simulated_behind_ones_back(memo: MemoRobot) -> None:
    walk(memo, "TURN_LEFT")
    with memo.known_only():
        walk(memo, "TURN_LEFT")
        with pytest.raises(Unsimulated, match="ATTACK leads to after TURN_LEFT is not known") as end:
            memo.act("ATTACK")
        assert (end.value.node, end.value.action) == (memo.node, "ATTACK")
    memo.extend(end.value.node, "ATTACK")
    assert walk(memo, "TURN_LEFT", "ATTACK") == 2


def test_spares_stand_where_they_were_left(robot: DoomRobot, plain: DoomRobot) -> None:
    alone = MemoRobot(robot, PERCEPTION_KEYS)
    spared = MemoRobot(DoomRobot(), PERCEPTION_KEYS, spares=[DoomRobot()])
    for memo, expected in ((alone, 6), (spared, 4)):
        walk(memo, "TURN_LEFT")
        walk(memo, "ATTACK", scene=OTHER)
        walk(memo, "TURN_LEFT", "ATTACK")
        assert walk(memo, "ATTACK", "TURN_LEFT", scene=OTHER) == expected
        plain.reset(OTHER)
        plain.act("ATTACK")
        plain.act("TURN_LEFT")
        assert frame_match(memo.observe(), plain.observe())
    spared.close()


def test_robots_that_others_have_used_are_reset(memo: MemoRobot, robot: DoomRobot) -> None:
    walk(memo, "TURN_LEFT")
    memo.leave()
    robot.reset(OTHER)
    assert walk(memo, "TURN_LEFT", "ATTACK") == 3
    assert memo.state().ammo == 49
