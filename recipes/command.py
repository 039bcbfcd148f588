"""Recipes as commands: what a user did wrong is told in one line, with the exit statuses of `evaps`."""

from __future__ import annotations

import sys
from collections.abc import Callable

from evaps.cli.command import INTERRUPTED, WRONG_INPUT
from evaps.dsl import UserError


def start(recipe: Callable[[], None]) -> None:
    """Run a recipe.

    Raises:
        SystemExit: the input is wrong, or somebody has stopped it; other faults show where they are.
    """
    try:
        recipe()
    except UserError as error:
        _end(str(error), WRONG_INPUT)
    except KeyboardInterrupt:
        _end("stopped; the same command goes on from there", INTERRUPTED)


def _end(message: str, status: int) -> None:
    print(f"evaps: {message}", file=sys.stderr)
    raise SystemExit(status) from None
