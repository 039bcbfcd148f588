"""What mkdocs cannot do by itself: the page of the command line, and links to files that are not in `docs/`.

A hook of mkdocs.yml. `mkdocs build` makes the site; `mkdocs serve` shows it while one writes.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any, get_args

COMMANDS_MARK = "<!-- commands -->"
COLUMNS = "100"


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Fill in the commands, and name the files outside of `docs/` instead of linking to them."""
    if COMMANDS_MARK in markdown:
        markdown = markdown.replace(COMMANDS_MARK, "\n\n".join(map(_section, command_names())))
    return re.sub(r"\[([^\]]+)\]\(\.\./([^)]+)\)", _as_name, markdown)


def command_names() -> list[str]:
    """All commands, in the order of `evaps --help`."""
    from evaps.cli.main import AnyCommand

    return [get_args(each)[1].name for each in get_args(AnyCommand)]


def _section(command: str) -> str:
    evaps = [Path(sys.executable).with_name("evaps"), command, "--help"]
    environment = {**os.environ, "COLUMNS": COLUMNS, "NO_COLOR": "1", "TERM": "dumb"}
    done = subprocess.run(evaps, capture_output=True, text=True, check=True, env=environment)
    return f"## evaps {command}\n\n```text\n{done.stdout.strip()}\n```"


def _as_name(link: re.Match[str]) -> str:
    text, path = link.groups()
    return f"`{path}`" if text.strip("`") == path else f"{text} (`{path}` in the repository)"
