"""What evaps needs of a machine, whether it is there, and how to mend it if not."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

from evaps.domain import CHOSEN, DOOM

EXTRAS = {
    "report": (["matplotlib"], "figures of `evaps report`"),
    "cluster": (["ray"], "--engine ray"),
    "track": (["tensorboard"], "--tensorboard"),
    "viewer": (["fastapi", "uvicorn"], "`evaps studio`"),
    "hub": (["huggingface_hub"], "--model hub:OWNER/NAME"),
}
LEAST_MEMORY = 4 << 30  # bytes for a synthesis with its five engines
LEAST_DISK = 5 << 30  # bytes; a data set of 20,000 tasks has 2 GB
SHIPPED_FOR = ("doom", "karel")
"""Domains that evaps has checkpoints for."""


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    Attributes:
        what: its name.
        found: what was found, or what is wrong and how to mend it.
        well: whether it is as it has to be.
        needed: whether anything fails without it.
    """

    what: str
    found: str
    well: bool = True
    needed: bool = True


def examine() -> Iterator[Finding]:
    """Look at everything, the most basic things first."""
    yield Finding("evaps", f"{version('evaps')} in {Path(__file__).parent}")
    yield Finding("Python", sys.version.split()[0])
    robot = _engine if CHOSEN is DOOM else _world
    for look in (_libraries, _torch, robot, _checkpoints, _cores, _memory, _disk):
        yield _guarded(look)
    for extra, (modules, what) in EXTRAS.items():
        if missing := [module for module in modules if find_spec(module) is None]:
            told = f"{missing[0]} is missing: {what} needs it; try: pip install 'evaps[{extra}]'"
            yield Finding(f"extra {extra}", told, well=False, needed=False)
        else:
            found = ", ".join(f"{module} {_version(module)}" for module in modules)
            yield Finding(f"extra {extra}", found, needed=False)


def _guarded(look: Callable[[], Finding]) -> Finding:
    """Whatever goes wrong while looking is what was found."""
    try:
        return look()
    except Exception as error:
        return Finding(look.__name__.strip("_"), f"{type(error).__name__}: {error}", well=False)


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown version"


def _libraries() -> Finding:
    from evaps.libraries import how_to_mend, missing

    packages = missing()
    return Finding("libraries", how_to_mend(packages) if packages else "all there", not packages)


def _torch() -> Finding:
    import torch

    from evaps.models.compute import device, precision

    return Finding("torch", f"{torch.__version__}, computing in {precision()} on {device()}")


def _engine() -> Finding:
    """Start the engine, take a step, and look."""
    from evaps.robots.base import Pose, Scene, Thing
    from evaps.robots.doom import DoomRobot

    robot = DoomRobot()
    try:
        robot.reset(Scene(Pose(-300, 240, 0), (Thing("Demon", -100, 240),)))
        robot.act("TURN_LEFT")
        seen = robot.observe().rgb.shape
    finally:
        robot.close()
    return Finding("engine", f"ViZDoom {_version('vizdoom')} runs; a view has {seen[0]} x {seen[1]} pixels")


def _world() -> Finding:
    """The robot of another domain than Doom's, on a random scene."""
    from evaps.robots.world import world

    height, width = world().size
    return Finding(f"domain {CHOSEN.name}", f"{world().version}; a view has {height} x {width} pixels")


def _checkpoints() -> Finding:
    from evaps.models import load_model, model_folder
    from evaps.models.checkpoint import CheckpointError

    try:
        load_model()
    except CheckpointError as error:  # those of Doom and Karel have to be there, others need not
        return Finding("checkpoints", str(error), well=False, needed=CHOSEN.name in SHIPPED_FOR)
    folder = model_folder(CHOSEN.model)
    size = sum(file.stat().st_size for file in folder.rglob("*.safetensors"))
    names = ", ".join(sorted(path.name for path in folder.iterdir()))
    return Finding("checkpoints", f"{names}: {size / 1e6:.1f} MB")


def _cores() -> Finding:
    return Finding("cores", str(len(os.sched_getaffinity(0))))


def _memory() -> Finding:
    free = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_AVPHYS_PAGES")
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    text = f"{total / 2**30:.1f} GiB, {free / 2**30:.1f} of them free"
    well = total >= LEAST_MEMORY
    return Finding(
        "memory", text if well else f"{text}; five engines and torch want 4 GiB", well, needed=False
    )


def _disk() -> Finding:
    free = shutil.disk_usage(".").free
    text = f"{free / 1e9:.1f} GB free here"
    well = free >= LEAST_DISK
    return Finding(
        "disk", text if well else f"{text}; a data set of 20,000 tasks has 2 GB", well, needed=False
    )
