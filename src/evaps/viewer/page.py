"""The report page: one HTML file that shows what came of some tasks, readable anywhere, offline."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from evaps.files import write_atomically
from evaps.viewer.render import render
from evaps.viewer.story import TaskReport, telling_example

__all__ = ["TaskReport", "render_page", "write_page"]


def write_page(path: Path, reports: Sequence[TaskReport]) -> None:
    """Write the report page of some tasks, with everything that it shows inside.

    The file is whole or not there.

    Args:
        path: the HTML file; folders that are missing are made.
        reports: the tasks, in the order in which they are shown.
    """
    write_atomically(path, render_page(reports).encode())


def render_page(reports: Sequence[TaskReport]) -> str:
    """The report page as a text.

    Args:
        reports: the tasks, in the order in which they are shown.
    """
    return render(
        "page.html",
        goals=[example.goal for report in reports for example in report.task.examples],
        title="Programs from examples",
        reports=reports,
        most_examples=max((len(r.task.examples) for r in reports), default=0),
        telling_example=telling_example,
    )
