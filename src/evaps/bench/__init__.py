"""How fast things are, measured in turns in one run, since machines are noisy: ratios say more than rates."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator
from pathlib import Path

from evaps.bench.engine import engine_figures
from evaps.bench.generation import generation_figures
from evaps.bench.memory import memory_figures
from evaps.bench.models import feature_figures, synthesis_figures, training_figures
from evaps.bench.tasks import random_tasks
from evaps.bench.timing import Figure
from evaps.models import load_model
from evaps.models.compute import precision
from evaps.robots.doom import DoomRobot

__all__ = ["Figure", "bench", "machine"]


def bench(model: str, seconds: float = 5.0, batch: int = 32) -> Iterator[Figure]:
    """Measure everything, one figure after the other.

    Args:
        model: a shipped set of checkpoints, or a folder of them.
        seconds: about how long a rate is measured.
        batch: programs that a method learns from at a time.
    """
    robot = DoomRobot()
    try:
        loaded = load_model(model, "evaps")
        yield from engine_figures(robot)
        tasks = random_tasks(robot, max(2, int(4 * seconds)))
        yield from memory_figures(robot, loaded, tasks[: max(2, int(2.4 * seconds))])
        yield from generation_figures(robot, seconds)
        yield from feature_figures(loaded, tasks)
        yield from synthesis_figures(robot, loaded, tasks, "synthesis with repair")
        yield from synthesis_figures(robot, load_model(model), tasks, "verified synthesis")
    finally:
        robot.close()
    yield from training_figures(seconds, batch)


def machine() -> str:
    """What the figures were measured on: processor, cores, precision."""
    name = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        lines = [line for line in cpuinfo.read_text().splitlines() if line.startswith("model name")]
        name = lines[0].split(":")[1].strip() if lines else name
    return f"{name}, {os.cpu_count()} cores, {precision()}"
