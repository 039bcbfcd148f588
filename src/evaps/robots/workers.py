"""Work for robots in several processes, each with an engine of its own on a core of its own."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from functools import cache
from multiprocessing import connection
from typing import Any, ClassVar, TypeVar

from evaps.robots.base import EngineError, Scene
from evaps.robots.doom import DoomRobot, interrupts_blocked
from evaps.robots.memo import MemoRobot

Item = TypeVar("Item")
Result = TypeVar("Result")


def robot_map(
    function: Callable[[MemoRobot, Item], Result],
    items: Iterable[Item],
    workers: int,
    perceptions: tuple[str, ...],
) -> Iterator[tuple[Item, Result]]:
    """Call ``function(robot, item)`` for every item, on ``workers`` processes; results come as they are done.

    A function must depend on nothing but its item, so that neither the order nor the number of workers
    matters. An engine that dies is replaced and its item done once more.

    Args:
        function: a module-level function.
        items: drawn as workers become free, so that there may be endlessly many.
        workers: how many processes; 0 does the work in this one.
        perceptions: what programs may ask the robot.
    """
    if workers == 0:
        yield from ((item, _call(function, item, perceptions)) for item in items)
        return
    context = multiprocessing.get_context("spawn")  # torch and forks do not go together
    started, stop = context.Value("i", 0), context.Event()
    pool = ProcessPoolExecutor(workers, context, _start_worker, (started, stop))
    pending: dict[Future[Any], Item] = {}
    source = iter(items)
    try:
        while True:
            while len(pending) < 2 * workers and (item := next(source, None)) is not None:
                with interrupts_blocked():
                    future = pool.submit(_call, function, item, perceptions)
                pending[future] = item
            if not pending:
                return
            for future in wait(pending, return_when=FIRST_COMPLETED).done:
                yield pending.pop(future), future.result()
    finally:
        stop.set()  # an item may take minutes, and nobody waits for it any more
        pool.shutdown(wait=True, cancel_futures=True)


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


def _start_worker(started: Any, stop: Any) -> None:
    os.setpgid(0, 0)  # with its engine, so that one signal ends both
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _WorkerRobot.stop = stop
    with started.get_lock():
        number = started.value
        started.value += 1
    if hasattr(os, "sched_getaffinity"):
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {cores[number % len(cores)]})


def _end_with_parent() -> None:
    """Nothing stays behind if the parent is killed."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    connection.wait([parent.sentinel])
    os.killpg(0, signal.SIGKILL)


@cache
def _robot(perceptions: tuple[str, ...]) -> MemoRobot:
    return MemoRobot(_WorkerRobot(), perceptions)


def _call(function: Callable[[MemoRobot, Item], Result], item: Item, perceptions: tuple[str, ...]) -> Result:
    robot = _robot(perceptions)
    robot.forget()
    try:
        return function(robot, item)
    except EngineError:
        robot.close()
        robot.forget()
        return function(robot, item)
    finally:
        robot.forget()
