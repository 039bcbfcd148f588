"""Telling apart what is made from different things: hashes for names, and the version of the code."""

from __future__ import annotations

import hashlib
import json
import subprocess
from functools import cache
from pathlib import Path
from typing import Any


def short_hash(value: Any) -> str:
    """Twelve hexadecimal digits that depend on a JSON value and nothing else."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:12]


@cache
def code_version() -> str:
    """The commit of the code that runs, with ``-dirty`` if it was changed since; "unknown" if installed.

    It is read once in a process, so that it belongs to the code that was loaded.
    """
    root = Path(__file__).parents[3]
    command = ["git", "describe", "--always", "--dirty", "--exclude=*"]
    if not (root / ".git").exists():
        return "unknown"
    try:
        done = subprocess.run(command, capture_output=True, text=True, cwd=root)
    except OSError:
        return "unknown"
    return done.stdout.strip() or "unknown"
