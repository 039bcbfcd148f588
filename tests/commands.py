"""The commands that pages show."""

from __future__ import annotations

import re
import subprocess
import sys
from functools import cache
from pathlib import Path

EVAPS = Path(sys.executable).with_name("evaps")


@cache
def help_of(command: str) -> str:
    """What `evaps COMMAND --help` prints."""
    shown = subprocess.run([EVAPS, command, "--help"], capture_output=True, text=True)
    assert shown.returncode == 0, command
    return shown.stdout


def check_commands(page: str) -> int:
    """Each command that a page shows, a line each, exists, and so do its options; how many there are."""
    commands = re.findall(r"^evaps (\S+)([^#\n]*)", page, re.MULTILINE)
    for command, rest in commands:
        for option in re.findall(r"--[a-z-]+", rest):
            assert option in help_of(command), f"evaps {command} has no {option}"
        assert help_of(command)
    return len(commands)
