"""Work for robots in several processes, each with engines of its own on a core of its own."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from multiprocessing import connection
from typing import Any, ClassVar, Generic, TypeVar

from evaps.robots.base import EngineError, Scene
from evaps.robots.doom import DoomRobot
from evaps.robots.engine import interrupts_blocked, settle
from evaps.robots.memo import MemoRobot

Item = TypeVar("Item")
Result = TypeVar("Result")

_END = object()
TRIES = 3  # how often a worker may die in turn without anything being done
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
    lost: deque[Any] = deque()  # what a worker was doing when it died
    deaths = 0
    pool = _Pool[Item](workers)
    try:
        while True:
            while len(pool.pending) < 2 * workers and pool.alive:
                item = lost.popleft() if lost else next(source, _END)
                if item is _END:
                    break
                pool.submit(function, item, config)
            if not pool.pending:
                return
            for item, result in pool.done():
                deaths = 0
                yield item, result
            if not pool.alive:
                deaths += 1
                if deaths == TRIES:
                    raise EngineError(f"workers have died {TRIES} times in turn before anything was done")
                lost.extend(pool.pending.values())
                pool.end()
                pool = _Pool[Item](workers)
    finally:
        pool.end()


class _Pool(Generic[Item]):
    """Worker processes that all end when one of them has died."""

    def __init__(self, workers: int) -> None:
        context = multiprocessing.get_context("spawn")  # torch and forks do not go together
        self.alive = True
        self.pending: dict[Future[Any], Item] = {}
        self._started, self._stop = context.Value("i", 0), context.Event()
        self._pids = context.Array("i", workers)
        shared = (self._started, self._stop, self._pids)
        self._executor = ProcessPoolExecutor(workers, context, _start_worker, shared)

    def submit(self, function: Callable[[MemoRobot, Item], Any], item: Item, config: RobotConfig) -> None:
        try:
            with interrupts_blocked():
                future = self._executor.submit(call, function, item, config)
        except BrokenProcessPool:
            self.alive = False
            future = Future()  # never done: it is lost with the others
        self.pending[future] = item

    def done(self) -> Iterator[tuple[Item, Any]]:
        """Wait for some results; those that died with a worker stay pending."""
        if not self.alive:
            return
        for future in wait(self.pending, return_when=FIRST_COMPLETED).done:
            if isinstance(future.exception(), BrokenProcessPool):
                self.alive = False
            else:
                yield self.pending.pop(future), future.result()

    def end(self) -> None:
        """End all workers, and the engines of those that have died."""
        self._stop.set()  # an item may take minutes, and nobody waits for it any more
        if not self.alive:
            for pid in filter(None, self._pids[:]):
                with suppress(OSError):
                    os.killpg(pid, signal.SIGKILL)
        self._executor.shutdown(wait=True, cancel_futures=True)


class _Stopped(Exception):  # noqa: N818 - nothing is wrong
    """Nobody waits for what this worker does."""


class _WorkerRobot(DoomRobot):
    """Ends the item under way soon after the parent has stopped waiting."""

    stop: ClassVar[Any] = None  # an event; None where the work is done in the parent itself

    def reset(self, scene: Scene) -> None:
        self._check()
        super().reset(scene)

    def act(self, action: str) -> None:
        self._check()
        super().act(action)

    def _check(self) -> None:
        if self.stop is not None and self.stop.is_set():
            raise _Stopped


def _start_worker(started: Any, stop: Any, pids: Any) -> None:
    os.setpgid(0, 0)  # with its engines, so that one signal ends all
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _WorkerRobot.stop = stop
    with started.get_lock():
        number = started.value
        started.value += 1
    pids[number % len(pids)] = os.getpid()
    settle(core_of(number))


def core_of(number: int) -> int | None:
    """The core for a worker of this machine, by its number; None where cores cannot be chosen."""
    if not hasattr(os, "sched_getaffinity"):
        return None
    cores: Sequence[int] = sorted(os.sched_getaffinity(0))
    return cores[number % len(cores)]


def _end_with_parent() -> None:
    """Nothing stays behind if the parent is killed."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    connection.wait([parent.sentinel])
    os.killpg(0, signal.SIGKILL)


@cache
def _robot(config: RobotConfig) -> MemoRobot:
    spares = [_WorkerRobot() for _ in range(config.spares)]
    return MemoRobot(_WorkerRobot(), config.perceptions, config.eager, spares=spares)


def call(function: Callable[[MemoRobot, Item], Result], item: Item, config: RobotConfig) -> Result:
    """Do one item in this process, on a robot that remembers nothing of the ones before."""
    robot = _robot(config)
    robot.forget()
    try:
        return function(robot, item)
    finally:
        robot.forget()
