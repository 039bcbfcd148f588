"""Recipes as commands: what a user did wrong is told in one line, with the exit statuses of `evaps`."""

from __future__ import annotations

from collections.abc import Callable

from evaps.cli.command import INTERRUPTED, WRONG_INPUT, end
from evaps.dsl import UserError


def start(recipe: Callable[[], None]) -> None:
    """Run a recipe.

    Raises:
        SystemExit: the input is wrong, or somebody has stopped it; other faults show where they are.
    """
    try:
        recipe()
    except UserError as error:
        raise SystemExit(end(WRONG_INPUT, str(error))) from None
    except KeyboardInterrupt:
        raise SystemExit(end(INTERRUPTED, "stopped; the same command goes on from there")) from None
