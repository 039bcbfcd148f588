"""Who does long work: the options that the commands have in common."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Literal, TypeAlias

from evaps.cli.inputs import check_least
from evaps.dsl import UserError

if TYPE_CHECKING:
    from evaps.robots.workers import Workers

Engine: TypeAlias = Literal["local", "ray"]


def available_cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def workers_from(count: int, engine: Engine = "local", address: str | None = None) -> Workers:
    """The workers that the options describe.

    Raises:
        UserError: there cannot be so many, or an address has no use.
    """
    check_least(workers=(count, 0))
    if address is not None and engine != "ray":
        raise UserError("--address is that of a Ray cluster; it needs --engine ray")
    from evaps.robots.workers import Workers

    return Workers(count, engine, address)
