"""Finding the processes that engines run in."""

from contextlib import suppress
from pathlib import Path


def find_engines(pid: int) -> set[int]:
    """The engine processes below a process."""
    lists = Path(f"/proc/{pid}/task").glob("*/children")
    children: set[int] = set()
    for path in lists:
        with suppress(OSError):  # a thread that has just ended
            children.update(map(int, path.read_text().split()))
    own = {child for child in children if name_of(child) == "vizdoom"}
    return own.union(*map(find_engines, children - own))


def name_of(pid: int) -> str:
    """The name of a process; empty if it has just ended."""
    with suppress(OSError):
        return Path(f"/proc/{pid}/comm").read_text().strip()
    return ""
