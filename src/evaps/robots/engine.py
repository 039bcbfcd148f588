"""The ViZDoom engine as a process: started with our world, kept on one core, watched, and ended."""

from __future__ import annotations

import ctypes
import hashlib
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import chdir, contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import psutil

from evaps.robots.base import EngineError
from evaps.robots.frames import Image
from evaps.robots.guard import GUARD, arguments_of, shared_memory
from evaps.robots.wad import arena_wad, unpack

WIDTH, HEIGHT = 160, 120
BUTTONS = ("MOVE_FORWARD", "MOVE_BACKWARD", "MOVE_LEFT", "MOVE_RIGHT", "TURN_LEFT", "TURN_RIGHT", "ATTACK")
"""What can be pressed; behind them comes a turn by so many degrees, with which a scene's heading is set."""
VARIABLES = ("POSITION_X", "POSITION_Y", "ANGLE", "HEALTH", "AMMO2")
"""The robot's own numbers, in this order, and behind them those that stand still when the robot does."""
MOTION = ("POSITION_Z", "VELOCITY_X", "VELOCITY_Y", "VELOCITY_Z", "VIEW_HEIGHT", "PITCH")
TIME_LIMIT = 30.0  # seconds for a call that usually takes 0.001; longer, and the engine hangs
MEMORY_LIMIT = 1 << 30  # bytes; it usually holds 16 MB
_STARTING = threading.Lock()

Result = TypeVar("Result")


class Engine:
    """A running engine with the arena loaded; nobody holds it any more: it ends.

    Args:
        time_limit: an engine that needs so many seconds for a call is killed, and the call raises.

    Attributes:
        pid: of its process.

    Raises:
        EngineError: it cannot be started.
    """

    def __init__(self, time_limit: float = TIME_LIMIT) -> None:
        files = tempfile.TemporaryDirectory(prefix="evaps-")
        wad = Path(files.name) / "arena.wad"
        wad.write_bytes(arena_wad())
        check_wad(wad)
        self._core = None if is_settled() else core_of(os.getpid())  # None: a turn has nothing to change
        GUARD.add(files.name)
        with self._at_its_core():  # which its process inherits
            self.game = start_engine(wad)
        self.pid = _pid_of(wad)
        GUARD.add(files.name, self.pid, shared_memory(arguments_of(self.pid)))
        self._watch = _Watch(self.pid, time_limit)
        self.close = weakref.finalize(self, _end, self.game, files, self._watch, os.getpid())
        """End the process."""

    def call(self, work: Callable[[Any], Result]) -> Result:
        """Work on the ``vizdoom.DoomGame``, on the engine's own core, and for no longer than the limit.

        The two processes take turns, tic by tic: on one core a tic costs 14 us, across cores 57 us.

        Raises:
            EngineError: the engine has died, or was killed since it hung.
        """
        with self._at_its_core():
            self._watch.since = time.monotonic()
            try:
                return work(self.game)
            except _engine_errors() as error:
                raise EngineError(f"the ViZDoom engine has died ({_one_line(error)})") from error
            finally:
                self._watch.since = None

    @contextmanager
    def _at_its_core(self) -> Iterator[None]:
        before = None if self._core is None else _sit_down(self._core)
        try:
            yield
        finally:
            if before is not None:
                _stand_up(*before)

    @property
    def memory(self) -> int:
        """Bytes that its process holds; 0 if it has died."""
        try:
            return int(psutil.Process(self.pid).memory_info().rss)
        except (psutil.Error, TypeError):
            return 0


class _Watch:
    """Kills an engine that takes too long for a call: the call then raises, as if the engine had died.

    Its start is not watched: vizdoom 1.3 itself faults if an engine dies before it has answered.
    """

    def __init__(self, pid: int | None, limit: float) -> None:
        self.pid, self.limit = pid, limit
        self.since: float | None = None
        self.over = threading.Event()
        threading.Thread(target=self._look, daemon=True, name="evaps-watch").start()

    def _look(self) -> None:
        while not self.over.wait(min(1.0, self.limit / 4)):
            since = self.since
            if since is not None and time.monotonic() - since > self.limit and self.pid is not None:
                with suppress(OSError):
                    os.kill(self.pid, signal.SIGKILL)


def _end(game: Any, files: tempfile.TemporaryDirectory[str], watch: _Watch, owner: int) -> None:
    """Kill it: it has nothing to save, and one that hangs would let no thread of this process go on."""
    if os.getpid() != owner:  # a fork's end is not the end of the engine
        files._finalizer.detach()  # type: ignore[attr-defined]
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(game))  # it would wait for threads that are not here
        return
    watch.over.set()
    if watch.pid is not None:
        with suppress(OSError):
            os.kill(watch.pid, signal.SIGKILL)
    game.close()
    files.cleanup()
    GUARD.remove(files.name)


def _pid_of(wad: Path) -> int | None:
    """The engine that was started with this file; None where processes cannot be listed."""
    with suppress(psutil.Error, OSError):
        for child in psutil.Process().children():
            with suppress(psutil.Error):
                if str(wad) in child.cmdline():
                    return int(child.pid)
    return None


def core_of(number: int) -> int | None:
    """One of the cores that this process may use, by a number; None where cores cannot be chosen."""
    if not hasattr(os, "sched_getaffinity"):
        return None
    cores = sorted(os.sched_getaffinity(0))
    return cores[number % len(cores)]


def settle(core: int | None) -> None:
    """Bind this thread, and what it starts, to a core, for as long as it lives, and let it not preempt.

    A process that is woken up usually preempts the one that woke it, which then has to be woken up once more:
    under the policy for batches a tic costs 14 us instead of 18.
    """
    if not hasattr(os, "sched_setaffinity"):
        return
    if core is not None:
        os.sched_setaffinity(0, {core})
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))


def is_settled() -> bool:
    """Whether this thread runs on one core and does not preempt."""
    if not hasattr(os, "sched_setaffinity"):
        return True
    return len(os.sched_getaffinity(0)) == 1 and os.sched_getscheduler(0) != os.SCHED_OTHER


def _sit_down(core: int) -> tuple[set[int], int]:
    """Settle this thread; what it was before."""
    before = os.sched_getaffinity(0), os.sched_getscheduler(0)
    settle(core)
    return before


def _stand_up(cores: set[int], policy: int) -> None:
    """Make this thread what it was before."""
    os.sched_setaffinity(0, cores)
    with suppress(OSError):
        os.sched_setscheduler(0, policy, os.sched_param(0))


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
        # The engine makes a folder where it is started, and all threads are in one place: one at a time.
        with _STARTING, interrupts_blocked(), chdir(wad.parent):
            game.init()
    except Exception as error:
        raise EngineError(f"the ViZDoom engine cannot start: {_one_line(error)}") from error
    return game


@cache
def _engine_errors() -> tuple[type[Exception], ...]:
    """What calls raise when the engine is not there any more; anything else is a fault of ours."""
    vizdoom = _vizdoom()
    names = ("ViZDoomErrorException", "ViZDoomIsNotRunningException", "ViZDoomUnexpectedExitException")
    more = ("MessageQueueException", "SharedMemoryException")
    return tuple(getattr(vizdoom, name) for name in (*names, *more))


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
    buttons = [getattr(vizdoom.Button, name) for name in BUTTONS]
    game.set_available_buttons([*buttons, vizdoom.Button.TURN_LEFT_RIGHT_DELTA])
    names = [getattr(vizdoom.GameVariable, name) for name in (*VARIABLES, *MOTION)]
    game.set_available_game_variables(names)
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
    code = "import sys, pathlib, evaps.robots.engine as e; e.start_engine(pathlib.Path(sys.argv[1]))"
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
