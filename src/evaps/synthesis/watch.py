"""Following a search while it runs, and ending it early."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from evaps.dsl import Program


@dataclass(frozen=True)
class News:
    """What has happened in a search.

    Attributes:
        text: in a few words.
        passed: for each example, whether its goal is reached so far, by the best program or on its own.
        program: the best one so far, if there is one.
        actions: simulated so far.
        seconds: since the search began.
    """

    text: str
    passed: tuple[bool, ...]
    program: Program | None
    actions: int
    seconds: float


@dataclass(frozen=True)
class Watch:
    """Whoever follows a search.

    Attributes:
        tell: called with what has happened.
        stopped: asked now and then; once it is true, the search comes back with the best that it has.
    """

    tell: Callable[[News], None] = lambda news: None
    stopped: Callable[[], bool] = lambda: False


NOBODY = Watch()
