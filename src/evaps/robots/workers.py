"""Work for robots in several processes, each with engines of its own on a core of its own."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import threading
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import connection
from typing import Any, ClassVar, TypeVar

from evaps.robots.base import EngineError, Robot
from evaps.robots.engine import core_of, interrupts_blocked, settle
from evaps.robots.memo import MemoRobot
from evaps.robots.world import world

Item = TypeVar("Item")
Result = TypeVar("Result")

END_WITHIN = 30.0  # seconds that a worker has to end by itself, with all its engines
_END = object()
_SPAWN = multiprocessing.get_context("spawn")  # torch and forks do not go together
TRIES = 3  # workers that an item may cost
BACKENDS = ("local", "ray")
"""Where workers run: processes on this machine, or a Ray cluster."""


@dataclass(frozen=True)
class Workers:
    """How many workers there are, where, and what robot each of them has.

    Attributes:
        count: how many; 0 does the work in this process.
        backend: a name in BACKENDS.
        address: of a Ray cluster; None takes RAY_ADDRESS, or starts one on this machine.
    """

    count: int
    backend: str = "local"
    address: str | None = None


TWO = Workers(2)


@dataclass(frozen=True)
class RobotConfig:
    """What robot a worker has.

    Attributes:
        perceptions: what programs may ask it.
        eager: whether it looks at every place that it comes to; see `MemoRobot`.
        spares: engines beside the first one; see `MemoRobot`.
    """

    perceptions: tuple[str, ...]
    eager: bool = True
    spares: int = 0


def robot_map(
    function: Callable[[MemoRobot, Item], Result],
    items: Iterable[Item],
    workers: Workers,
    config: RobotConfig,
) -> Iterator[tuple[Item, Result]]:
    """Call ``function(robot, item)`` for every item; results come as they are done.

    A function must depend on nothing but its item, so that neither the order nor the number of workers
    matters. An engine that dies is replaced, and so is a worker: its item is done once more.

    Args:
        function: a module-level function.
        items: drawn as workers become free, so that there may be endlessly many.
        workers: how many, and where.
        config: of their robots.

    Raises:
        EngineError: no engine can be started, or an item kills one worker after the other.
        UserError: there is no Ray, or no such cluster.
    """
    if workers.backend == "ray":
        from evaps.robots.ray_workers import ray_map

        return ray_map(function, items, workers, config)
    if workers.count == 0:
        return ((item, call(function, item, config)) for item in items)
    return _process_map(function, items, workers.count, config)


def _process_map(
    function: Callable[[MemoRobot, Item], Result], items: Iterable[Item], workers: int, config: RobotConfig
) -> Iterator[tuple[Item, Result]]:
    source: Iterator[Any] = iter(items)
    lost: list[tuple[Any, int]] = []  # what workers were doing when they died, and how many it has cost
    stop = _SPAWN.RawValue("b", 0)  # without a lock, which a worker could take with it when it dies
    pool = [_Worker(number, stop) for number in range(workers)]
    busy: dict[_Worker, tuple[Any, int]] = {}
    try:
        while True:
            for worker in pool:
                if worker not in busy:
                    item, deaths = lost.pop() if lost else (next(source, _END), 0)
                    if item is not _END:
                        busy[worker] = item, deaths
                        worker.give((function, item, config))
            if not busy:
                return
            for worker in _ready(busy):
                (item, deaths), (done, result) = busy.pop(worker), worker.take()
                if done:
                    yield item, result
                    continue
                if deaths + 1 == TRIES:
                    raise EngineError(f"{TRIES} workers have died one after the other of the same work")
                lost.append((item, deaths + 1))
                worker.kill()
                pool[worker.number] = _Worker(worker.number, stop)
    finally:
        stop.value = 1  # an item may take minutes, and nobody waits for it any more
        for worker in pool:  # all of them are told before the first is waited for
            worker.pipe.close()
        try:
            for worker in pool:
                worker.end()
        except BaseException:  # a second Ctrl-C: at once, then
            for worker in pool:
                worker.kill()
            raise


class _Worker:
    """A process that does one item after the other, and a pipe to it.

    It never gets an item while it is busy: then neither side ever waits for the other to read.
    """

    def __init__(self, number: int, stop: Any) -> None:
        self.number = number
        self.pipe, theirs = _SPAWN.Pipe()
        self.process = _SPAWN.Process(target=_serve, args=(theirs, number, stop), daemon=True)
        with interrupts_blocked():
            self.process.start()
        theirs.close()

    def give(self, work: tuple[Any, ...]) -> None:
        with suppress(OSError):  # if it has died, that is seen when its result is taken
            self.pipe.send(work)

    def take(self) -> tuple[bool, Any]:
        """Whether the item is done, and its result; raises what the item has raised."""
        try:
            result, error = self.pipe.recv()
        except (EOFError, OSError):
            return False, None
        if error is not None:
            raise error
        return True, result

    def kill(self) -> None:
        """End it at once, with its engines."""
        assert self.process.pid is not None
        with suppress(OSError):  # it may have ended before it had a group of its own
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.kill()
        self.process.join()
        self.pipe.close()

    def end(self) -> None:
        """Let it end by itself, since its pipe is closed, and if it does not, end it."""
        self.process.join(END_WITHIN)
        self.kill()


def _ready(busy: Iterable[_Worker]) -> list[_Worker]:
    """Those that have a result, or have died."""
    by_pipe = {worker.pipe: worker for worker in busy}
    return [by_pipe[pipe] for pipe in connection.wait(list(by_pipe))]  # type: ignore[index]


def _serve(pipe: Any, number: int, stop: Any) -> None:
    """What a worker's process does."""
    os.set_inheritable(pipe.fileno(), False)  # or an engine would keep it open when this process dies
    os.setpgid(0, 0)  # with its engines, so that one signal ends all
    threading.Thread(target=_end_with_parent, daemon=True).start()
    signal.signal(signal.SIGTERM, lambda *_: os.killpg(0, signal.SIGKILL))
    _Stop.flag = stop
    settle(core_of(number))
    with suppress(EOFError, OSError):  # the parent has closed the pipe: there is nothing more to do
        while True:
            pipe.send(_answer(*pipe.recv()))


def _answer(function: Callable[..., Any], item: Any, config: RobotConfig) -> tuple[Any, Exception | None]:
    """The result of an item, or the error that it has raised."""
    try:
        return call(function, item, config), None
    except Exception as error:
        error.add_note(f"In a worker:\n{traceback.format_exc()}")  # it does not travel by itself
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:
            return None, RuntimeError(f"{type(error).__name__}: {error}")
        return None, error


class _Stopped(Exception):  # noqa: N818 - nothing is wrong
    """Nobody waits for what this worker does."""


class _Stop:
    """Ends the item under way soon after the parent has stopped waiting."""

    flag: ClassVar[Any] = None  # None where the work is done in the parent itself

    @classmethod
    def checked_by(cls, method: Callable[..., None]) -> Callable[..., None]:
        """The method, which is not called any more when nobody waits for it."""

        def checked(argument: Any) -> None:
            if cls.flag is not None and cls.flag.value:
                raise _Stopped
            method(argument)

        return checked


def _worker_robot() -> Robot:
    robot = world().robot()
    for name in ("reset", "act"):
        setattr(robot, name, _Stop.checked_by(getattr(robot, name)))
    return robot


def _end_with_parent() -> None:
    """Nothing stays behind if the parent is killed."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    connection.wait([parent.sentinel])
    os.killpg(0, signal.SIGKILL)


_robots: dict[RobotConfig, MemoRobot] = {}
"""Those of this process; they live as long as it does."""


def _robot(config: RobotConfig) -> MemoRobot:
    if config not in _robots:
        spares = [_worker_robot() for _ in range(config.spares)]
        _robots[config] = MemoRobot(_worker_robot(), config.perceptions, config.eager, spares=spares)
    return _robots[config]


def close_robots() -> None:
    """End the engines of this process's robots."""
    for robot in _robots.values():
        robot.close()


def call(function: Callable[[MemoRobot, Item], Result], item: Item, config: RobotConfig) -> Result:
    """Do one item in this process, on a robot that remembers nothing of the ones before."""
    robot = _robot(config)
    robot.forget()
    try:
        return function(robot, item)
    finally:
        robot.forget()
