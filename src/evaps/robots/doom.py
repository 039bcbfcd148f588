"""The Doom robot: programs acting in a 3D arena of stock ViZDoom, seen through RGB and depth."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
import tempfile
import weakref
from collections.abc import Iterator
from contextlib import chdir, contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from evaps.robots.base import (
    EngineError,
    Image,
    Observation,
    PaletteFrame,
    Pose,
    Robot,
    Scene,
    ThingState,
    WorldState,
)
from evaps.robots.scenes import validate
from evaps.robots.wad import PREFIX, RADII, arena_wad, unpack

ROBOT = "doom-v0"
"""Names the robot and its version, which rises when equal programs may come to show other frames."""
WIDTH, HEIGHT = 160, 120
CENTRE_X, CENTRE_Y = WIDTH // 2, HEIGHT // 2

# Each action presses one button for some tics and then waits until the world is at rest: with fewer
# tics of rest the robot still slides, and equal worlds stop looking equal.
TICS = {
    "MOVE_FORWARD": (5, 45),
    "MOVE_BACKWARD": (5, 45),
    "MOVE_LEFT": (5, 45),
    "MOVE_RIGHT": (5, 45),
    "TURN_LEFT": (5, 5),
    "TURN_RIGHT": (5, 5),
    "ATTACK": (1, 80),
}
TICS_BEFORE_TURN = 14  # in the first tics of an episode the engine takes no turn
REST_AFTER_RESET = 40  # straight after a warp the view height is still wrong
_BUTTONS = {action: [float(action == other) for other in TICS] + [0.0] for action in TICS}
_NO_BUTTON = [0.0] * (len(TICS) + 1)
_NO_SCENE = "the robot has no scene yet: call reset(scene) first"


class DoomRobot(Robot):
    """A robot with a pistol in a room of monsters and clips, on stock ViZDoom.

    ## Description
    One rectangular room, 640 by 448 map units. Demons, HellKnights and Revenants stand still and die of one
    bullet; walking over a Clip picks it up. The world is deterministic: from one scene, one sequence of
    actions always gives the same bytes.

    ## Actions
    ``MOVE_FORWARD MOVE_BACKWARD MOVE_LEFT MOVE_RIGHT`` (5 tics of 1/35 s, then 45 of rest), ``TURN_LEFT
    TURN_RIGHT`` (8.79 degrees), ``ATTACK`` (one bullet straight ahead).

    ## Perceptions
    ``ISTHERE m``: a living m has a visible pixel. ``INTARGET m``: the box around a visible living m strictly
    contains the centre of the view. m is ``Demon``, ``HellKnight`` or ``Revenant``.

    ## Observations
    RGB, uint8 ``[120, 160, 3]``, and depth, uint8 ``[120, 160]`` (about 14 levels per 100 map units).

    ## Units
    Places in map units, headings in degrees counter-clockwise from east.

    The engine is a process of its own; it starts with the first reset and ends with :meth:`close`.
    """

    def __init__(self) -> None:
        self._game: Any = None
        self._end: Any = None
        self._state: Any = None
        self._view: PaletteFrame | None = None
        self._core: int | None = None

    def reset(self, scene: Scene) -> None:
        """Put the world back to the start of ``scene``.

        Raises:
            SceneError: the scene is not valid.
            EngineError: the engine cannot be started, or has died.
        """
        validate(scene)
        if self._game is None:
            self._start()
        with self._engine() as game:
            game.set_seed(0)
            game.new_episode()
            self._place(scene)
            self._rest(REST_AFTER_RESET)

    def act(self, action: str) -> None:
        """Press the button of ``action``, release it, and wait until the world is at rest."""
        pressed, rest = TICS[action]
        with self._engine() as game:
            game.set_action(_BUTTONS[action])
            game.advance_action(pressed, False)
            game.set_action(_NO_BUTTON)
            self._rest(rest)

    def perceive(self, perception: str) -> bool:
        """``ISTHERE m`` or ``INTARGET m`` in the current view.

        Raises:
            ValueError: the robot has no such perception.
        """
        name, _, kind = perception.partition(" ")
        if name not in ("ISTHERE", "INTARGET") or kind not in RADII:
            raise ValueError(f"the Doom robot has no perception {perception!r}")
        boxes = [box for box in self._seen().labels if box.object_name == PREFIX + kind]
        return bool(boxes) if name == "ISTHERE" else any(map(_on_centre, boxes))

    def observe(self) -> Observation:
        """The current view."""
        if self._view is None:
            seen = self._seen()
            self._view = PaletteFrame(seen.screen_buffer, seen.depth_buffer, doom_palette())
        return self._view

    def state(self) -> WorldState:
        """The hidden state, for evaluation alone."""
        x, y, heading, health, ammo = self._seen().game_variables
        things = [
            ThingState(name.removeprefix(PREFIX), not dead, round(o.position_x, 2), round(o.position_y, 2))
            for o in self._seen().objects
            for dead, name in [(o.name.startswith("Dead"), o.name.removeprefix("Dead"))]
            if name.removeprefix(PREFIX) in RADII
        ]
        things.sort(key=lambda t: (t.kind, t.x, t.y))
        pose = Pose(round(float(x), 2), round(float(y), 2), round(float(heading), 2))
        return WorldState(pose, int(ammo), int(health), tuple(things))

    def close(self) -> None:
        """End the engine's process."""
        if self._end is not None:
            self._end()
        self._game = self._end = self._state = self._view = None

    def _place(self, scene: Scene) -> None:
        # `summon` puts a thing in front of the robot at 2 radii + 16, and `warp` kills what it lands on: so
        # from the largest x to the smallest, each time standing to the west of everything placed before.
        for thing in sorted(scene.things, key=lambda t: -t.x):
            self._game.send_game_command(f"warp {thing.x - 2 * RADII[thing.kind] - 16} {thing.y}")
            name = PREFIX + thing.kind if thing.kind != "Clip" else thing.kind
            self._game.send_game_command(f"summon {name}")
            self._game.advance_action(1, False)
        self._game.send_game_command(f"warp {scene.robot.x} {scene.robot.y}")
        self._game.advance_action(max(1, TICS_BEFORE_TURN - len(scene.things)), False)
        self._game.set_action([*_NO_BUTTON[:-1], -float(scene.robot.heading)])
        self._game.advance_action(1, False)
        self._game.set_action(_NO_BUTTON)

    def _rest(self, tics: int) -> None:
        """Let the world come to rest, and look at it.

        Two tics are rendered, since the numbers that a frame shows are those of the frame before: with one,
        the ammunition would still be that of the action before, or of another scene.
        """
        self._game.advance_action(tics - 1, True)
        self._game.advance_action(1, True)
        self._state, self._view = self._game.get_state(), None

    def _seen(self) -> Any:
        if self._state is None:
            raise EngineError(_NO_SCENE)
        return self._state

    @contextmanager
    def _engine(self) -> Iterator[Any]:
        """The engine, while this thread runs on the engine's own core.

        The two processes take turns, tic by tic: on one core a tic costs 14 us, across cores 57 us.
        """
        if self._game is None:
            raise EngineError(_NO_SCENE)
        before = _move_to(self._core)
        try:
            yield self._game
        except Exception as error:
            self.close()
            raise EngineError(f"the ViZDoom engine has died ({_one_line(error)}); reset the robot") from error
        finally:
            if before is not None:
                os.sched_setaffinity(0, before)

    def _start(self) -> None:
        files = tempfile.TemporaryDirectory(prefix="evaps-")
        wad = Path(files.name) / "arena.wad"
        wad.write_bytes(arena_wad())
        check_wad(wad)
        cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
        self._core = cores[os.getpid() % len(cores)] if len(cores) > 1 else None
        before = _move_to(self._core)  # the engine's process inherits it
        try:
            self._game = start_engine(wad)
            self._end = weakref.finalize(self, _end, self._game, files)
        finally:
            if before is not None:
                os.sched_setaffinity(0, before)


def _end(game: Any, files: tempfile.TemporaryDirectory[str]) -> None:
    game.close()
    files.cleanup()


def _move_to(core: int | None) -> set[int] | None:
    """Bind this thread to ``core``; what it was bound to before, to be restored."""
    if core is None:
        return None
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {core})
    return before


def _on_centre(box: Any) -> bool:
    return bool(box.x < CENTRE_X < box.x + box.width and box.y < CENTRE_Y < box.y + box.height)


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())[:200]


def start_engine(wad: Path) -> Any:
    """A running ``vizdoom.DoomGame`` with the map in ``wad``, configured as the robot needs it.

    Raises:
        EngineError: why it cannot be started, in one line.
    """
    vizdoom = _vizdoom()
    game = vizdoom.DoomGame()
    _configure(game, vizdoom, wad)
    try:
        with interrupts_blocked(), chdir(wad.parent):  # the engine makes a folder where it is started
            game.init()
    except Exception as error:
        raise EngineError(f"the ViZDoom engine cannot start: {_one_line(error)}") from error
    return game


def _vizdoom() -> Any:
    try:
        import vizdoom
    except ImportError as error:
        message = f"vizdoom cannot be loaded: {_one_line(error)}; try: pip install vizdoom"
        raise EngineError(message) from error
    return vizdoom


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Processes that start in here never see Ctrl-C: it is this one's to handle, when it comes out."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _configure(game: Any, vizdoom: Any, wad: Path) -> None:
    game.set_doom_scenario_path(str(wad))
    game.set_doom_config_path(str(wad.with_suffix(".ini")))  # else it writes one into the current folder
    game.set_doom_map("map01")
    game.set_doom_skill(3)
    game.set_episode_timeout(0)
    game.set_mode(vizdoom.Mode.PLAYER)
    game.add_game_args("+sv_cheats 1")
    buttons = [getattr(vizdoom.Button, action) for action in TICS]
    game.set_available_buttons([*buttons, vizdoom.Button.TURN_LEFT_RIGHT_DELTA])
    names = ("POSITION_X", "POSITION_Y", "ANGLE", "HEALTH", "AMMO2")
    game.set_available_game_variables([getattr(vizdoom.GameVariable, name) for name in names])
    game.set_screen_resolution(vizdoom.ScreenResolution.RES_160X120)
    game.set_screen_format(vizdoom.ScreenFormat.DOOM_256_COLORS8)
    game.set_depth_buffer_enabled(True)
    game.set_labels_buffer_enabled(True)
    game.set_objects_info_enabled(True)
    game.set_window_visible(False)
    game.set_sound_enabled(False)
    for shown in ("hud", "minimal_hud", "weapon", "corpses"):
        getattr(game, f"set_render_{shown}")(True)
    for hidden in ("crosshair", "decals", "particles", "messages"):
        getattr(game, f"set_render_{hidden}")(False)


@cache
def doom_palette() -> Image:
    """The engine's 256 colours, uint8 ``[256, 3]``: the first palette of the freedoom2.wad in vizdoom."""
    wad = Path(_vizdoom().__file__).with_name("freedoom2.wad").read_bytes()
    palette = np.frombuffer(unpack(wad, "PLAYPAL")[:768], np.uint8).reshape(256, 3)
    palette.flags.writeable = False
    return palette


def check_wad(wad: Path) -> None:
    """Start the engine once with ``wad`` in a child process, since a fault in its text kills the process.

    What has passed is remembered by its hash in the user's cache folder, so this costs time only once.

    Raises:
        EngineError: why the engine cannot start with it, in one line.
    """
    key = hashlib.sha256(wad.read_bytes() + _vizdoom().__version__.encode()).hexdigest()[:16]
    cache_folder = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")) / "evaps"
    passed = cache_folder / f"wad-{key}"
    if os.path.exists(passed):  # False, too, where the folder may not be read
        return
    code = "import sys, pathlib, evaps.robots.doom as doom; doom.start_engine(pathlib.Path(sys.argv[1]))"
    command = [sys.executable, "-c", code, str(wad)]
    try:
        child = subprocess.run(command, capture_output=True, text=True, timeout=120)
    except subprocess.TimeoutExpired:
        raise EngineError("the ViZDoom engine does not start within two minutes") from None
    if child.returncode:
        lines = (child.stderr or child.stdout).strip().splitlines() or ["no message"]
        reason = lines[-1].removeprefix(f"{EngineError.__module__}.EngineError: ")
        if child.returncode < 0:
            reason = f"signal {-child.returncode}"
        raise EngineError(f"the ViZDoom engine cannot start with this world: {reason}")
    with suppress(OSError):  # where nothing can be written, it is checked again next time
        cache_folder.mkdir(parents=True, exist_ok=True)
        passed.touch()
