"""The robot that remembers: the same as the plain one, whatever ran before, and nothing twice."""

import os
import signal
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from evaps.dsl import Program, Trace, run
from evaps.dsl.sampler import PERCEPTION_KEYS, sample_program
from evaps.robots.base import EngineError, Pose, Scene, Thing
from evaps.robots.frames import Observation, frame_match
from evaps.robots.doom import DoomRobot
from evaps.robots.memo import MemoRobot
from evaps.robots.scenes import random_scene

Engines = Callable[[int], set[int]]
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
    for name in ("reset", "act", "observe", "perceive", "state"):
        monkeypatch.setattr(memo.robot, name, lambda *_, name=name: calls.append(name))
    memo.reset(SCENE)
    for action in path:
        memo.act(action)
    assert memo.observe() is last
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


def test_it_goes_on_after_the_engine_has_died(engines: Engines, plain: DoomRobot) -> None:
    others = engines(os.getpid())
    memo = MemoRobot(DoomRobot(), PERCEPTION_KEYS)
    path = ["TURN_LEFT", "MOVE_FORWARD", "ATTACK", "MOVE_LEFT"]
    memo.reset(SCENE)
    for action in path[:2]:
        memo.act(action)
    (engine,) = engines(os.getpid()) - others
    os.kill(engine, signal.SIGKILL)
    with pytest.raises(EngineError):
        memo.act(path[2])
    assert memo.simulated_actions == 2
    for action in path[2:]:  # it still knows where it stands
        memo.act(action)
    assert memo.simulated_actions == 6, "two replayed"
    plain.reset(SCENE)
    for action in path:
        plain.act(action)
    assert frame_match(memo.observe(), plain.observe())
    assert memo.state() == plain.state()
    memo.close()
    assert engines(os.getpid()) == others
