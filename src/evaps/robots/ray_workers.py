"""The same work as in `evaps.robots.workers` on a Ray cluster, of this machine or of many."""

from __future__ import annotations

import logging
import os
import socket
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from evaps.dsl import UserError
from evaps.robots.base import EngineError
from evaps.robots.engine import core_of, is_settled, settle
from evaps.robots.memo import MemoRobot
from evaps.robots.workers import TRIES, RobotConfig, Workers, call, close_robots

Item = TypeVar("Item")
Result = TypeVar("Result")

PLACED_WITHIN = 60.0  # seconds that a cluster has to find a processor for each worker
CLOSED_WITHIN = 5.0  # seconds that workers have to end their engines
ANSWERS_WITHIN = 5.0  # seconds that the head of a cluster has to accept a connection


class RayWorker:
    """An actor with robots of its own; Ray starts it again if its process dies."""

    def node(self) -> str:
        """The node that it runs on."""
        import ray

        return str(ray.get_runtime_context().get_node_id())

    def call(
        self,
        function: Callable[[MemoRobot, Item], Result],
        item: Item,
        config: RobotConfig,
        number: int,
    ) -> Result:
        """Do one item, on the node's core with this number.

        Actors run their methods on one thread each, which is what is bound to the core.
        """
        if not is_settled():
            settle(core_of(number))
        return call(function, item, config)

    def close(self) -> None:
        """End the engines."""
        close_robots()


def ray_map(
    function: Callable[[MemoRobot, Item], Result],
    items: Iterable[Item],
    workers: Workers,
    config: RobotConfig,
) -> Iterator[tuple[Item, Result]]:
    """Call ``function(robot, item)`` for every item on a Ray cluster; results come as they are done.

    What items and results hold travels with them, so the nodes need evaps and what it needs, and no common
    folder. If a worker dies, Ray starts it again and its item is done once more, up to three times.

    Raises:
        EngineError: an item kills one worker after the other.
        UserError: ray is not installed, there is no such cluster, or it has too few free processors.
    """
    count = max(1, workers.count)
    ray, is_ours = _connect(workers.address, count)
    actors: dict[Any, int] = {}
    try:
        actors = _actors(ray, count)
        idle, running = list(actors), {}
        source = iter(items)
        while True:
            while idle:
                for item in source:
                    actor = idle.pop()
                    running[actor.call.remote(function, item, config, actors[actor])] = actor, item
                    break
                else:
                    break
            if not running:
                return
            (done,), _ = ray.wait(list(running), num_returns=1)
            actor, item = running.pop(done)
            idle.append(actor)
            yield item, _result(ray, done)
    finally:
        ray.wait([actor.close.remote() for actor in actors], num_returns=len(actors), timeout=CLOSED_WITHIN)
        for actor in actors:
            ray.kill(actor)
        if is_ours:
            ray.shutdown()


def _connect(address: str | None, workers: int) -> tuple[Any, bool]:
    """Ray, and whether the connection is ours to close: a program that has one keeps it."""
    address = address or os.environ.get("RAY_ADDRESS")
    try:
        import ray
    except ImportError:
        raise UserError("ray is not installed; try: pip install 'evaps[cluster]'") from None
    if ray.is_initialized():
        return ray, False
    if address is not None:
        _check_address(address)
    try:
        # "local": else Ray may join whatever cluster somebody else has started on this machine
        ray.init(
            address or "local",
            num_cpus=None if address else workers,
            log_to_driver=False,
            logging_level=logging.ERROR,
            include_dashboard=False,
        )
    except (ConnectionError, RuntimeError, ValueError) as error:
        reason = " ".join(str(error).split())[:200]
        raise UserError(f"there is no Ray cluster at {address!r}: {reason}") from None
    return ray, True


def _check_address(address: str) -> None:
    """Ray itself looks for a head that is not there for minutes.

    Raises:
        UserError: nobody listens there.
    """
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if host and port.isdecimal():
        try:
            socket.create_connection((host, int(port)), ANSWERS_WITHIN).close()
        except OSError as error:
            raise UserError(f"there is no Ray cluster at {address!r}: {error.strerror or error}") from None


def _actors(ray: Any, count: int) -> dict[Any, int]:
    """So many workers, each with a number that no other has on its node."""
    actor_class = ray.remote(num_cpus=1, max_restarts=-1, max_task_retries=TRIES)(RayWorker)
    actors = [actor_class.remote() for _ in range(count)]
    asked = [actor.node.remote() for actor in actors]
    placed, waiting = ray.wait(asked, num_returns=count, timeout=PLACED_WITHIN)
    if waiting:
        for actor in actors:
            ray.kill(actor)
        raise UserError(
            f"{len(placed)} of {count} workers found a free processor in the Ray cluster within "
            f"{PLACED_WITHIN:.0f} s; ask for fewer with --workers"
        )
    numbers: Counter[str] = Counter()
    placement = {}
    for actor, node in zip(actors, ray.get(asked), strict=True):
        placement[actor] = numbers[node]
        numbers[node] += 1
    return placement


def _result(ray: Any, done: Any) -> Any:
    try:
        return ray.get(done)
    except ray.exceptions.RayTaskError as error:
        raise error.cause if isinstance(error.cause, Exception) else error from None
    except ray.exceptions.RayActorError as error:
        raise EngineError(f"workers have died {TRIES + 1} times in turn before anything was done") from error
