"""Templates of pages, and the functions that they call."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from evaps.dsl import token_type
from evaps.robots.frames import Observation
from evaps.robots.world import world
from evaps.viewer.highlight import python_spans
from evaps.viewer.pictures import Pictures
from evaps.viewer.story import line_views, rounds, steps

COLOURS = Path(__file__).parent / "colours.css"
"""The style sheet with the colours of all pages."""
CHECKS_SHOWN = 5  # of the conditions evaluated at one view; a loop without an action can have dozens


def render(template: str, goals: Sequence[Observation], lossy: bool = False, **values: Any) -> str:
    """A page as a text.

    Args:
        template: its file in this folder.
        goals: all that it shows; the furthest of them is white where depth is shown.
        lossy: whether pictures may lose a little, which makes the page half as large.
        values: what the template shows.
    """
    return (
        _environment()
        .get_template(template)
        .render(
            # The template shows pictures; those that it has shown stand at the page's end.
            pictures=Pictures(lossy=lossy),
            furthest=max((int(goal.depth.max()) for goal in goals), default=0),
            checks_shown=CHECKS_SHOWN,
            depth_says_something=world().depth,
            **values,
        )
    )


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals.update(
        line_views=line_views,
        python_spans=python_spans,
        rounds=rounds,
        steps=steps,
        token_type=token_type,
    )
    return environment
