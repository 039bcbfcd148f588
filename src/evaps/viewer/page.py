"""The report page: one HTML file that shows what came of some tasks, readable anywhere, offline."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from evaps.dsl import token_type
from evaps.files import write_atomically
from evaps.robots.world import world
from evaps.viewer.highlight import python_spans
from evaps.viewer.pictures import Pictures
from evaps.viewer.story import TaskReport, line_views, rounds, steps, telling_example

__all__ = ["TaskReport", "render_page", "write_page"]

TITLE = "Programs from examples"
COLOURS = Path(__file__).parent / "colours.css"
"""The style sheet with the colours of all pages."""
CHECKS_SHOWN = 5  # of the conditions evaluated at one view; a loop without an action can have dozens


def write_page(
    path: Path,
    reports: Sequence[TaskReport],
    title: str = TITLE,
    lead: Sequence[str] = (),
    lossy: bool = False,
) -> None:
    """Write the report page of some tasks, with everything that it shows inside.

    The file is whole or not there.

    Args:
        path: the HTML file; folders that are missing are made.
        reports: the tasks, in the order in which they are shown.
        title: the page's heading.
        lead: paragraphs below it, before what every such page says.
        lossy: whether pictures may lose a little, which makes the file half as large.
    """
    write_atomically(path, render_page(reports, title, lead, lossy).encode())


def render_page(
    reports: Sequence[TaskReport], title: str = TITLE, lead: Sequence[str] = (), lossy: bool = False
) -> str:
    """The report page as a text.

    Args:
        reports: the tasks, in the order in which they are shown.
        title: the page's heading.
        lead: paragraphs below it, before what every such page says.
        lossy: whether pictures may lose a little.
    """
    template = _environment().get_template("page.html")
    return template.render(
        reports=reports,
        title=title,
        lead=lead,
        # The template shows pictures; those that it has shown stand at the page's end.
        pictures=Pictures(lossy=lossy),
        most_examples=max((len(r.task.examples) for r in reports), default=0),
        furthest=max((int(e.goal.depth.max()) for r in reports for e in r.task.examples), default=0),
        checks_shown=CHECKS_SHOWN,
        depth_says_something=world().depth,
    )


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
        telling_example=telling_example,
        token_type=token_type,
    )
    return environment
