"""What came of a task, shown: a report page and a summary in the terminal."""

from evaps.viewer.page import write_page
from evaps.viewer.story import TaskReport
from evaps.viewer.terminal import show_solution

__all__ = ["TaskReport", "show_solution", "write_page"]
