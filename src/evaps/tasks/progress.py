"""How long jobs show that they are alive: a bar with a rate and the time left, or a line a minute."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

T = TypeVar("T")
LINE_EVERY, LINE_EVERY_VERBOSE = 60.0, 5.0  # seconds, where there is no terminal

CONSOLE = Console(stderr=True)


@dataclass
class Loudness:
    """What is said beside results, of this process.

    Attributes:
        quiet: no progress.
        verbose: progress more often, and what a search finds as it goes on.
    """

    quiet: bool = False
    verbose: bool = False


LOUDNESS = Loudness()


def note(text: str) -> None:
    """Say on standard error what a long job does otherwise than one might expect."""
    if not LOUDNESS.quiet:
        CONSOLE.print(text, soft_wrap=True)


def track(items: Iterable[T], total: int, what: str, done: int = 0, per_item: int = 1) -> Iterator[T]:
    """Yield the items and show progress on standard error.

    Args:
        items: what to go through.
        total: how many units the whole job has.
        what: the job's name.
        done: how many units were done before.
        per_item: how many units an item is worth.
    """
    if LOUDNESS.quiet:
        return iter(items)
    return (_bar if CONSOLE.is_terminal else _lines)(items, total, what, done, per_item)


def _bar(items: Iterable[T], total: int, what: str, done: int, per_item: int) -> Iterator[T]:
    start, before = time.monotonic(), done
    columns = [
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
    ]
    with Progress(*columns, TimeRemainingColumn(), console=CONSOLE) as progress:
        bar = progress.add_task(what, total=total, completed=done, rate="")
        for item in items:
            yield item
            done = min(done + per_item, total)
            rate = (done - before) / (time.monotonic() - start)
            progress.update(bar, completed=done, rate=f"{rate:.1f}/s")


def _lines(items: Iterable[T], total: int, what: str, done: int, per_item: int) -> Iterator[T]:
    start, before, shown = time.monotonic(), done, time.monotonic()
    for item in items:
        yield item
        done = min(done + per_item, total)
        if time.monotonic() - shown > (LINE_EVERY_VERBOSE if LOUDNESS.verbose else LINE_EVERY):
            shown = time.monotonic()
            rate = (done - before) / (shown - start)
            left = (total - done) / max(rate, 1e-9)
            CONSOLE.print(f"{what}: {done} of {total}, {rate:.1f}/s, {left / 60:.0f} min left")
