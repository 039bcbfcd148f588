"""Long jobs in parts: each part becomes files, so a job can be stopped at any moment and goes on later."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Protocol, TypeVar

from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.files import write_atomically
from evaps.robots.memo import MemoRobot
from evaps.robots.workers import RobotConfig, Workers, robot_map
from evaps.tasks.progress import track

ROBOT = RobotConfig(PERCEPTION_KEYS)

Files = Mapping[Path, bytes]
"""What a part becomes: the contents of its files, in the order in which they are written."""


class Part(Protocol):
    """Some of the work: all that it depends on, and the file that means that it is done."""

    @property
    def path(self) -> Path:
        """Written last, and atomically."""


P = TypeVar("P", bound=Part)


def make_parts(
    make: Callable[[MemoRobot, P], Files],
    parts: Sequence[P],
    workers: Workers,
    what: str,
    size: int,
    load: Callable[[P], P] = lambda part: part,
    robot: RobotConfig = ROBOT,
) -> list[Path]:
    """Make those parts whose files are not there yet.

    Workers read and write no files: what they need travels with the part, and what they made comes back.

    Args:
        make: a module-level function that makes a part.
        parts: all of them.
        workers: who makes them.
        what: what a part holds, for the progress.
        size: how many of these a part holds.
        load: adds to a part what has to be read from files; called here, just before it is made.
        robot: what robot a worker has.

    Returns:
        the files that mean that parts are done.
    """
    missing = [part for part in parts if not part.path.exists()]
    if not missing:
        return [part.path for part in parts]
    results = robot_map(make, (load(part) for part in missing), workers, robot)
    done = (len(parts) - len(missing)) * size
    for _, files in track(results, len(parts) * size, what, done, size):
        for path, content in files.items():
            write_atomically(path, content)
    return [part.path for part in parts]
