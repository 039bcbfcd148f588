"""Results that are no rows: JSON files that say which code and which machine have made them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from evaps.bench import machine
from evaps.files import write_atomically
from evaps.tasks.identity import code_version


def write_result(path: Path, found: Any) -> None:
    """Write what a recipe has found.

    Args:
        path: of the file.
        found: JSON values.
    """
    made = {"commit": code_version(), "machine": machine(), "found": found}
    write_atomically(path, (json.dumps(made, indent=1) + "\n").encode())


def read_result(path: Path) -> Any:
    """What `write_result` was given."""
    return json.loads(path.read_text())["found"]
