"""The Doom robot on the real engine: places, perceptions, actions, determinism, and an engine that dies."""

import hashlib
import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.robots import doom
from evaps.robots.base import EngineError, Pose, Scene, SceneError, Thing, WorldState
from evaps.robots.doom import TICS, DoomRobot
from evaps.robots.engine import Engine, check_wad
from evaps.robots.frames import frame_match
from evaps.robots.scenes import random_scene, validate
from evaps.robots.wad import KINDS, RADII, arena_wad

Engines = Callable[[int], set[int]]
ORIGIN = Pose(-192, 288, 0)


def scene(robot: tuple[int, int, int], *things: tuple[str, int, int]) -> Scene:
    return Scene(Pose(*robot), tuple(Thing(*thing) for thing in things))


def crowded_scene(seed: int) -> Scene:
    """Thirteen things on a shaken grid of fifteen places, with the robot between them."""
    rng = np.random.default_rng(seed)
    grid = [(x, y) for x in range(-416, 97, 128) for y in (96, 288, 480)]
    things = []
    for place in rng.permutation(len(grid))[:13]:
        x, y = np.array(grid[place]) + rng.integers(-20, 21, 2)
        kind = str(rng.choice(list(RADII)))
        things.append(Thing(kind, int(np.clip(x, -416, 96)), int(np.clip(y, 96, 480))))
    return Scene(Pose(-352, 192, int(rng.integers(360))), tuple(things))


def seen(robot: DoomRobot) -> set[str]:
    return {key for key in PERCEPTION_KEYS if robot.perceive(key)}


def play(robot: DoomRobot, start: Scene, *actions: str) -> WorldState:
    robot.reset(start)
    for action in actions:
        robot.act(action)
    return robot.state()


def digest(robot: DoomRobot) -> str:
    view = robot.observe()
    return hashlib.sha256(view.rgb.tobytes() + view.depth.tobytes()).hexdigest()


@pytest.mark.parametrize("seed", range(6))
def test_thirteen_things_stand_where_the_scene_says(robot: DoomRobot, seed: int) -> None:
    start = crowded_scene(seed)
    validate(start)
    state = play(robot, start)
    found = sorted((t.kind, t.x, t.y) for t in state.things)
    wanted = sorted((t.kind, t.x, t.y) for t in start.things)
    assert [kind for kind, _, _ in found] == [kind for kind, _, _ in wanted]
    np.testing.assert_allclose([t[1:] for t in found], [t[1:] for t in wanted], atol=0.01)
    assert all(t.alive for t in state.things)
    assert (state.ammo, state.health) == (50, 100)
    assert math.dist((state.robot.x, state.robot.y), (start.robot.x, start.robot.y)) <= 0.01
    assert state.robot.heading == pytest.approx(start.robot.heading, abs=0.0101)


@pytest.mark.parametrize("things", [(), (("Demon", -60, 420), ("Clip", -400, 120))], ids=["empty", "things"])
@pytest.mark.parametrize("heading", [0, 1, 45, 90, 135, 179, 180, 181, 225, 270, 315, 359])
def test_the_robot_looks_where_the_scene_says(
    robot: DoomRobot, heading: int, things: tuple[tuple[str, int, int], ...]
) -> None:
    state = play(robot, scene((-192, 288, heading), *things))
    assert state.robot.heading == pytest.approx(heading, abs=0.0101)


def test_views_are_bytes_of_the_documented_shape(robot: DoomRobot) -> None:
    play(robot, crowded_scene(0))
    view = robot.observe()
    assert (view.rgb.shape, view.rgb.dtype) == ((120, 160, 3), np.uint8)
    assert (view.depth.shape, view.depth.dtype) == ((120, 160), np.uint8)
    assert len(np.unique(view.rgb.reshape(-1, 3), axis=0)) > 20
    assert len(np.unique(view.depth)) > 10


def test_depth_grows_with_distance(robot: DoomRobot) -> None:
    depths = []
    for x in (96, -104, -304):
        play(robot, scene((x, 288, 0)))
        depths.append(int(robot.observe().depth[60, 80]))
    steps = np.diff(depths) / 2  # the wall is 200 map units further away each time
    assert all(12 <= step <= 16 for step in steps), depths


def test_a_view_that_was_handed_out_stays_as_it_was(robot: DoomRobot) -> None:
    play(robot, scene((-300, 280, 0), ("Demon", -100, 300)))
    view = robot.observe()
    rgb, depth = view.rgb.copy(), view.depth.copy()
    for action in TICS:
        robot.act(action)
    assert not frame_match(view, robot.observe())
    assert np.array_equal(view.rgb, rgb)
    assert np.array_equal(view.depth, depth)


class TestDeterminism:
    ACTIONS = ("MOVE_FORWARD", "ATTACK", "TURN_LEFT", "MOVE_LEFT", "ATTACK")
    SEEDS = range(8)

    def results(self, robot: DoomRobot, seeds: list[int]) -> dict[int, tuple[list[str], WorldState]]:
        found = {}
        for seed in seeds:
            robot.reset(random_scene(np.random.default_rng(seed)))
            views = [digest(robot)]
            for action in self.ACTIONS:
                robot.act(action)
                views.append(digest(robot))
            found[seed] = views, robot.state()
        return found

    def test_the_order_of_scenes_does_not_matter(self, robot: DoomRobot) -> None:
        forwards = self.results(robot, list(self.SEEDS))
        assert len({views[0] for views, _ in forwards.values()}) == len(self.SEEDS)
        play(robot, crowded_scene(1), *["MOVE_FORWARD", "ATTACK"] * 6)
        assert self.results(robot, list(reversed(self.SEEDS))) == forwards

    def test_another_process_sees_the_same_bytes(self, robot: DoomRobot) -> None:
        start = crowded_scene(2)
        code = f"""
import hashlib, json, sys
from evaps.robots.base import Scene
from evaps.robots.doom import DoomRobot
robot = DoomRobot()
robot.reset(Scene.from_json(json.loads(sys.argv[1])))
for action in [None, *{self.ACTIONS}]:
    if action:
        robot.act(action)
    view = robot.observe()
    print(hashlib.sha256(view.rgb.tobytes() + view.depth.tobytes()).hexdigest())
"""
        command = [sys.executable, "-c", code, json.dumps(start.to_json())]
        there = subprocess.run(command, capture_output=True, text=True, check=True, timeout=240)
        play(robot, start)
        here = [digest(robot)]
        for action in self.ACTIONS:
            robot.act(action)
            here.append(digest(robot))
        assert there.stdout.split() == here


class TestLooks:
    """A view is rendered when somebody looks, and who looked before makes no difference."""

    WALKS, LENGTH = 12, 8

    def walks(self) -> Iterator[tuple[Scene, list[str]]]:
        rng = np.random.default_rng(5)
        for _ in range(self.WALKS):
            start = random_scene(rng)
            clips = [t for t in start.things if t.kind == "Clip"]
            if clips:  # begin close to one, so that some are picked up
                start = Scene(Pose(max(-480, clips[0].x - 60), clips[0].y, 0), start.things)
            with suppress(SceneError):
                validate(start)
                shares = [0.35, 0.1, 0.1, 0.1, 0.1, 0.1, 0.15]
                yield start, [str(a) for a in rng.choice(list(TICS), self.LENGTH, p=shares)]

    def test_looking_once_or_always_shows_the_same(self, robot: DoomRobot) -> None:
        picked_up = 0
        for start, actions in self.walks():
            seen = []
            play(robot, start)
            for action in actions:
                robot.act(action)
                robot._fired = True  # so that two frames are rendered, and the number must be right
                seen.append((digest(robot), robot.fingerprint()))
            for lengths in (range(1, self.LENGTH + 1), (3, self.LENGTH), (self.LENGTH,)):
                robot.reset(start)
                for length, action in enumerate(actions, start=1):
                    robot.act(action)
                    if length in lengths:
                        assert (digest(robot), robot.fingerprint()) == seen[length - 1]
            picked_up += len(robot.state().things) < len(start.things)
        assert picked_up > 1

    def test_what_nobody_looks_at_is_not_rendered(
        self, robot: DoomRobot, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        rendered = []
        render = robot._render
        monkeypatch.setattr(robot, "_render", lambda game: rendered.append(1) or render(game))
        robot.reset(crowded_scene(0))
        for action in TICS:
            robot.act(action)
        assert not rendered
        for _ in range(2):
            robot.state(), robot.observe(), robot.perceive("ISTHERE Demon"), robot.fingerprint()
        assert len(rendered) == 1


def test_worlds_with_the_same_fingerprint_go_on_the_same_way(robot: DoomRobot) -> None:
    """The measurement behind the merging of places: 2,651 pairs like these never differed."""
    rng = np.random.default_rng(0)
    pairs = 0
    for _ in range(12):
        start = random_scene(rng)
        actions = [str(a) for a in rng.choice(list(TICS), 4)]
        ways: dict[object, list[str]] = {}
        for way in (
            [*actions],
            [*actions, "TURN_LEFT", "TURN_RIGHT"],
            *map(list, map(rng.permutation, [actions] * 4)),
        ):
            play(robot, start, *way)
            other = ways.setdefault((robot.fingerprint(), digest(robot)), way)
            if other != way:
                further = [str(a) for a in rng.choice(list(TICS), 5)]
                trails = []
                for begin in (way, other):
                    play(robot, start, *begin)
                    trails.append([])
                    for action in further:
                        robot.act(action)
                        trails[-1].append((digest(robot), robot.fingerprint(), seen(robot), robot.state()))
                assert trails[0] == trails[1]
                pairs += 1
    assert pairs > 10


@pytest.mark.parametrize("kind", KINDS)
class TestPerceptions:
    DISTANCE = 150

    def at(self, kind: str, heading: int, bearing: float) -> Scene:
        """One monster, so many degrees to the left of where the robot looks."""
        angle = math.radians(heading + bearing)
        x, y = ORIGIN.x + self.DISTANCE * math.cos(angle), ORIGIN.y + self.DISTANCE * math.sin(angle)
        return scene((int(ORIGIN.x), int(ORIGIN.y), heading), (kind, round(x), round(y)))

    @pytest.mark.parametrize("heading", [0, 90, 200, 310])
    @pytest.mark.parametrize("bearing", [-3, 0, 3])
    def test_straight_ahead(self, robot: DoomRobot, kind: str, heading: int, bearing: float) -> None:
        robot.reset(self.at(kind, heading, bearing))
        assert seen(robot) == {f"ISTHERE {kind}", f"INTARGET {kind}"}

    @pytest.mark.parametrize("heading", [0, 90, 200, 310])
    @pytest.mark.parametrize("bearing", [-35, -22, 22, 35])
    def test_to_the_side(self, robot: DoomRobot, kind: str, heading: int, bearing: float) -> None:
        robot.reset(self.at(kind, heading, bearing))
        assert seen(robot) == {f"ISTHERE {kind}"}

    @pytest.mark.parametrize("bearing", [-65, 65, 100, 180])
    def test_behind_or_out_of_view(self, robot: DoomRobot, kind: str, bearing: float) -> None:
        robot.reset(self.at(kind, 0, bearing))
        assert seen(robot) == set()

    def test_dead(self, robot: DoomRobot, kind: str) -> None:
        state = play(robot, self.at(kind, 90, 0), "ATTACK")
        assert seen(robot) == set()
        assert [(t.kind, t.alive) for t in state.things] == [(kind, False)]


def test_monsters_do_not_hide_one_another_entirely(robot: DoomRobot) -> None:
    """One bullet meets the nearest only, and the one behind it is in target from then on."""
    start = scene((-300, 280, 0), ("Revenant", 0, 280), ("Demon", -200, 280))
    robot.reset(start)
    assert seen(robot) == {"ISTHERE Demon", "INTARGET Demon", "ISTHERE Revenant", "INTARGET Revenant"}
    robot.act("ATTACK")
    assert seen(robot) == {"ISTHERE Revenant", "INTARGET Revenant"}
    robot.act("ATTACK")
    assert (seen(robot), robot.state().ammo) == (set(), 48)


@pytest.mark.parametrize("perception", ["ISTHERE", "ISTHERE Imp", "SEES Demon", "demon"])
def test_an_unknown_perception_is_refused(robot: DoomRobot, perception: str) -> None:
    robot.reset(Scene(ORIGIN))
    with pytest.raises(ValueError, match="no perception"):
        robot.perceive(perception)


class TestActions:
    @pytest.mark.parametrize("heading", [0, 30, 90, 217, 351])
    @pytest.mark.parametrize(("action", "sign"), [("TURN_LEFT", 1), ("TURN_RIGHT", -1)])
    def test_turns(self, robot: DoomRobot, action: str, sign: int, heading: int) -> None:
        state = play(robot, scene((-192, 288, heading)), action)
        assert state.robot.heading == pytest.approx((heading + sign * 8.79) % 360, abs=0.011)
        assert (state.robot.x, state.robot.y) == (-192, 288)

    @pytest.mark.parametrize("heading", [0, 60, 135, 250])
    @pytest.mark.parametrize(
        ("action", "direction", "distance"),
        [
            ("MOVE_FORWARD", 0, 41.11),
            ("MOVE_BACKWARD", 180, 41.12),
            ("MOVE_LEFT", 90, 39.41),
            ("MOVE_RIGHT", -90, 39.42),
        ],
    )
    def test_moves(
        self, robot: DoomRobot, action: str, direction: int, distance: float, heading: int
    ) -> None:
        after = play(robot, scene((-192, 288, heading)), action).robot
        angle = math.radians(heading + direction)
        wanted = (-192 + distance * math.cos(angle), 288 + distance * math.sin(angle))
        assert (after.x, after.y) == pytest.approx(wanted, abs=0.3)
        assert after.heading == heading

    def test_attack_kills_what_is_in_target_with_one_bullet(self, robot: DoomRobot) -> None:
        start = scene((-300, 280, 0), ("HellKnight", -100, 280), ("Demon", -100, 400))
        state = play(robot, start, "ATTACK")
        assert {(t.kind, t.alive) for t in state.things} == {("HellKnight", False), ("Demon", True)}
        assert state.ammo == 49

    def test_attack_at_nothing_costs_a_bullet_too(self, robot: DoomRobot) -> None:
        state = play(robot, scene((-300, 280, 0), ("Demon", -100, 400)), "ATTACK", "ATTACK")
        assert (state.ammo, [t.alive for t in state.things]) == (48, [True])

    def test_the_view_shows_the_ammunition_at_once(self, robot: DoomRobot) -> None:
        """The engine draws the number of the view before, so this takes a second view of the same world."""
        views = []
        for actions in (("TURN_LEFT",), ("TURN_LEFT", "ATTACK"), ("ATTACK", "TURN_LEFT")):
            play(robot, Scene(ORIGIN), *actions)
            views.append(robot.observe())
        assert frame_match(views[1], views[2])
        changed = np.argwhere((views[0].rgb != views[1].rgb).any(-1))
        assert len(changed)
        assert changed[:, 0].min() > 90, "only the number at the bottom changes"

    def test_a_new_scene_shows_its_own_ammunition(self, robot: DoomRobot) -> None:
        play(robot, Scene(ORIGIN))
        view = robot.observe()
        play(robot, Scene(ORIGIN), *["ATTACK"] * 3)
        robot.reset(Scene(ORIGIN))
        assert frame_match(robot.observe(), view)

    def test_walking_over_a_clip_adds_ammunition(self, robot: DoomRobot) -> None:
        start = scene((-300, 280, 0), ("Clip", -230, 280))
        assert play(robot, start).ammo == 50
        state = play(robot, start, "MOVE_FORWARD")
        assert (state.ammo, state.things) == (60, ())

    def test_a_monster_blocks_the_way(self, robot: DoomRobot) -> None:
        state = play(robot, scene((-300, 280, 0), ("Demon", -230, 280)), "MOVE_FORWARD", "MOVE_FORWARD")
        assert state.robot.x < -230 - 30 - 16 + 0.01

    def test_walls_block_the_way(self, robot: DoomRobot) -> None:
        state = play(robot, scene((96, 288, 0)), "MOVE_FORWARD", "MOVE_FORWARD")
        assert 96 < state.robot.x <= 128 - 16

    @pytest.mark.parametrize("heading", [0, 30, 245])
    def test_steps_ahead_and_to_the_left_may_be_swapped(self, robot: DoomRobot, heading: int) -> None:
        start = scene((-300, 280, heading), ("Demon", -100, 280), ("Clip", 0, 400))
        views = []
        for actions in (("MOVE_FORWARD", "MOVE_LEFT"), ("MOVE_LEFT", "MOVE_FORWARD")):
            play(robot, start, *actions)
            views.append(robot.observe())
        assert frame_match(*views)

    def test_an_unknown_action_is_refused_and_changes_nothing(self, robot: DoomRobot) -> None:
        before = play(robot, Scene(ORIGIN))
        with pytest.raises(KeyError):
            robot.act("JUMP")
        robot.act("TURN_LEFT")
        robot.act("TURN_RIGHT")
        assert robot.state() == before


def test_a_scene_that_is_not_valid_is_refused_and_changes_nothing(robot: DoomRobot) -> None:
    before = play(robot, scene((-300, 280, 0), ("Demon", -100, 300)))
    with pytest.raises(SceneError, match="overlap"):
        robot.reset(scene((-300, 280, 0), ("Demon", -290, 300)))
    assert robot.state() == before


@pytest.mark.parametrize(
    "call",
    [lambda r: r.act("ATTACK"), lambda r: r.perceive("ISTHERE Demon"), DoomRobot.observe, DoomRobot.state],
    ids=["act", "perceive", "observe", "state"],
)
def test_without_a_scene_there_is_nothing_to_do(call: Callable[[DoomRobot], object]) -> None:
    robot = DoomRobot()
    with pytest.raises(EngineError, match="call reset"):
        call(robot)
    robot.close()
    robot.close()


PATH = ("TURN_LEFT", "MOVE_FORWARD", "ATTACK", "MOVE_LEFT")


@pytest.fixture(scope="module")
def expected(robot: DoomRobot) -> tuple[list[str], WorldState]:
    """What is seen on the way, and the state in the end, of a robot that nothing happens to."""
    robot.reset(crowded_scene(3))
    seen = [digest(robot)]
    for action in PATH:
        robot.act(action)
        seen.append(digest(robot))
    return seen, robot.state()


class TestDeath:
    """Engines that die, hang or grow: nobody outside notices."""

    def engine_of(self, robot: DoomRobot) -> int:
        assert robot._engine is not None
        assert robot._engine.pid is not None
        return robot._engine.pid

    def kill(self, robot: DoomRobot) -> int:
        pid = self.engine_of(robot)
        os.kill(pid, signal.SIGKILL)
        return pid

    @pytest.mark.parametrize("moment", range(5))
    def test_a_dead_engine_is_replaced(
        self, engines: Engines, expected: tuple[list[str], WorldState], moment: int
    ) -> None:
        others = engines(os.getpid())
        robot = DoomRobot()
        robot.reset(crowded_scene(3))
        seen = []
        for step, action in enumerate((*PATH, None)):
            if step == moment:
                self.kill(robot)
            seen.append(digest(robot))
            if action is not None:
                robot.act(action)
        assert (seen, robot.state()) == expected
        assert len(engines(os.getpid())) == len(others) + 1
        robot.close()
        assert engines(os.getpid()) == others

    def test_an_engine_that_dies_in_the_middle_of_an_action_is_replaced(
        self, expected: tuple[list[str], WorldState]
    ) -> None:
        robot = DoomRobot()
        robot.reset(crowded_scene(3))
        pid = self.engine_of(robot)
        for action in PATH[:-1]:
            robot.act(action)
        os.kill(pid, signal.SIGSTOP)  # so that it is in the middle of the action for certain
        killer = threading.Timer(0.3, os.kill, (pid, signal.SIGKILL))
        killer.start()
        robot.act(PATH[-1])
        killer.join()
        assert (digest(robot), robot.state()) == (expected[0][-1], expected[1])
        assert self.engine_of(robot) != pid
        robot.close()

    def test_an_engine_that_hangs_is_replaced(self, expected: tuple[list[str], WorldState]) -> None:
        robot = DoomRobot(time_limit=0.5)
        robot.reset(crowded_scene(3))
        pid = self.engine_of(robot)
        os.kill(pid, signal.SIGSTOP)
        for action in PATH:
            robot.act(action)
        assert (digest(robot), robot.state()) == (expected[0][-1], expected[1])
        assert self.engine_of(robot) != pid
        robot.close()

    def test_a_stopped_engine_can_be_closed(self, engines: Engines) -> None:
        others = engines(os.getpid())
        robot = DoomRobot()
        robot.reset(crowded_scene(3))
        os.kill(self.engine_of(robot), signal.SIGSTOP)
        robot.close()
        assert engines(os.getpid()) == others

    def test_a_fault_of_ours_is_not_taken_for_its_death(self) -> None:
        robot = DoomRobot()
        robot.reset(crowded_scene(3))
        pid = self.engine_of(robot)
        assert robot._engine is not None
        with pytest.raises(ZeroDivisionError):
            robot._engine.call(lambda _: 1 / 0)
        robot.act("ATTACK")
        assert self.engine_of(robot) == pid
        robot.close()

    def test_an_engine_that_grows_is_replaced(self, monkeypatch: pytest.MonkeyPatch) -> None:
        robot = DoomRobot()
        robot.reset(crowded_scene(3))
        assert robot._engine is not None
        assert 1 << 20 < robot._engine.memory < doom.MEMORY_LIMIT
        pid, view = self.engine_of(robot), digest(robot)
        monkeypatch.setattr(doom, "CHECK_MEMORY_EVERY", 1)
        robot.reset(crowded_scene(3))
        assert self.engine_of(robot) == pid
        monkeypatch.setattr(doom, "MEMORY_LIMIT", 1 << 20)
        robot.reset(crowded_scene(3))
        assert self.engine_of(robot) != pid
        assert digest(robot) == view
        robot.close()

    def test_a_robot_whose_engines_all_die_says_so(
        self, engines: Engines, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        others = engines(os.getpid())
        robot = DoomRobot()
        robot.reset(Scene(ORIGIN))
        started = []

        def dead_at_once(limit: float) -> Engine:
            started.append(Engine(limit))
            os.kill(started[-1].pid or 0, signal.SIGKILL)
            return started[-1]

        monkeypatch.setattr(doom, "Engine", dead_at_once)
        self.kill(robot)
        with pytest.raises(EngineError, match="engine has died") as error:
            robot.act("ATTACK")
        assert "\n" not in str(error.value)
        assert len(started) == doom.TRIES - 1
        monkeypatch.undo()
        robot.act("TURN_LEFT")  # behind the shot, which was not lost
        assert robot.state().ammo == 49
        robot.close()
        assert engines(os.getpid()) == others

    def test_after_an_interruption_nothing_is_half_done(self, monkeypatch: pytest.MonkeyPatch) -> None:
        robot = DoomRobot()
        robot.reset(crowded_scene(3))
        robot.act("TURN_LEFT")
        press = robot._press

        def interrupted(game: object, action: str) -> None:
            game.set_action(doom.PRESSED[action])  # type: ignore[attr-defined]
            raise KeyboardInterrupt

        monkeypatch.setattr(robot, "_press", interrupted)
        with pytest.raises(KeyboardInterrupt):
            robot.act("ATTACK")
        monkeypatch.setattr(robot, "_press", press)
        view = digest(robot)
        assert robot.state().ammo == 49
        robot.reset(crowded_scene(3))
        robot.act("TURN_LEFT")
        robot.act("ATTACK")
        assert digest(robot) == view
        robot.close()

    def test_a_dead_engine_can_be_closed(self, engines: Engines) -> None:
        others = engines(os.getpid())
        robot = DoomRobot()
        robot.reset(Scene(ORIGIN))
        self.kill(robot)
        robot.close()
        assert engines(os.getpid()) == others

    def test_a_robot_that_nobody_holds_takes_its_engine_along(self, engines: Engines) -> None:
        others = engines(os.getpid())
        robot = DoomRobot()
        robot.reset(Scene(ORIGIN))
        assert len(engines(os.getpid())) == len(others) + 1
        del robot
        assert engines(os.getpid()) == others


class TestWorldThatCannotBe:
    def test_a_fault_in_its_text_is_one_line(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
        wad = tmp_path / "arena.wad"
        wad.write_bytes(arena_wad("actor Broken : NoSuchClass { Health }"))
        for _ in range(2):  # what has failed once is not taken for granted the next time
            with pytest.raises(EngineError, match="cannot start with this world") as error:
                check_wad(wad)
            assert "\n" not in str(error.value)

    def test_what_has_passed_is_not_started_again(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
        wad = tmp_path / "arena.wad"
        wad.write_bytes(arena_wad())
        check_wad(wad)
        monkeypatch.setattr(sys, "executable", "/no/such/python")
        check_wad(wad)
        wad.write_bytes(arena_wad() + b"\0")
        with pytest.raises(FileNotFoundError):
            check_wad(wad)

    def test_a_cache_that_cannot_be_written_does_no_harm(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        (tmp_path / "file").touch()
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
        wad = tmp_path / "arena.wad"
        wad.write_bytes(arena_wad())
        check_wad(wad)
        assert (tmp_path / "file").read_bytes() == b""


PLAY = """
import time
from evaps.robots.base import Pose, Scene
from evaps.robots.doom import DoomRobot
start = Scene(Pose(-192, 288, 0))
robot = DoomRobot()
robot.reset(start)
robot.act("ATTACK")
"""
ENDS = {
    "closed": "robot.close()",
    "left open": "",
    "two at once": "other = DoomRobot(); other.reset(start)",
    "exit": "raise SystemExit(0)",
}


@pytest.mark.parametrize("end", ENDS.values(), ids=ENDS)
def test_the_engine_says_nothing_and_leaves_nothing(tmp_path: Path, end: str) -> None:
    folders = {name: tmp_path / name for name in ("here", "home", "temporary")}
    for folder in folders.values():
        folder.mkdir()
    variables = {"HOME": str(folders["home"]), "TMPDIR": str(folders["temporary"]), "XDG_CACHE_HOME": ""}
    environment = {**os.environ, **variables}
    command = [sys.executable, "-c", PLAY + end]
    done = subprocess.run(
        command, cwd=folders["here"], env=environment, capture_output=True, text=True, timeout=240
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert not list(folders["here"].iterdir())
    assert not list(folders["temporary"].iterdir())
    files = [path for path in folders["home"].rglob("*") if path.is_file()]
    assert [path.parent.relative_to(folders["home"]) for path in files] == [Path(".cache/evaps")]


def test_ctrl_c_reaches_the_program_and_not_the_engine(
    engines: Engines, request: pytest.FixtureRequest
) -> None:
    code = f"""{PLAY}
try:
    print("plays", flush=True)
    while True:
        robot.reset(start)
except KeyboardInterrupt:
    robot.reset(start)
    robot.act("ATTACK")
    print("goes on", flush=True)
    time.sleep(60)
"""
    command = [sys.executable, "-c", code]
    job = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True)
    request.addfinalizer(job.kill)
    assert job.stdout is not None
    assert job.stdout.readline() == "plays\n"
    before = engines(job.pid)
    os.killpg(job.pid, signal.SIGINT)  # as a terminal does it
    assert job.stdout.readline() == "goes on\n"
    assert len(before) == 1
    assert engines(job.pid) == before
    os.killpg(job.pid, signal.SIGINT)
    job.wait(timeout=30)
    until = time.monotonic() + 10
    while (left := [pid for pid in before if Path(f"/proc/{pid}").exists()]) and time.monotonic() < until:
        time.sleep(0.05)
    assert not left


def test_engines_that_start_in_several_threads_leave_the_process_where_it_is() -> None:
    here, robots = os.getcwd(), [DoomRobot() for _ in range(6)]
    threads = [threading.Thread(target=robot.reset, args=(scene((0, 288, 0)),)) for robot in robots]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for robot in robots:
        assert robot.state().robot == Pose(0, 288, 0)
        robot.close()
    assert os.getcwd() == here
