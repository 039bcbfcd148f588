"""Shared libraries that the engine and torch need of the system, because no wheel brings them.

``python -m evaps.libraries`` says in one line what is missing, and fails then.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

DEBIAN = {
    "libstdc++.so.6": "libstdc++6",
    "libgcc_s.so.1": "libgcc-s1",
    "libz.so.1": "zlib1g",
    "libgomp.so.1": "libgomp1",
}
"""The Debian package that has a library."""

FILES = {"vizdoom": ("vizdoom", "vizdoom*.so"), "torch": ("lib/libtorch_cpu.so",)}
"""What may need them, in the folders of these packages."""


def missing() -> list[str]:
    """Debian packages, or libraries of which no package is known, that this machine lacks.

    None are found where there is no ``ldd`` to ask.
    """
    files = [str(file) for file in _files()]
    if not files or shutil.which("ldd") is None:
        return []
    said = subprocess.run(["ldd", *files], capture_output=True, text=True, check=False).stdout
    names = re.findall(r"^\s*(\S+) => not found", said, re.MULTILINE)
    return sorted({DEBIAN.get(name, name) for name in names})


def _files() -> Iterator[Path]:
    for package, patterns in FILES.items():
        if (spec := find_spec(package)) is not None and spec.origin is not None:
            for pattern in patterns:
                yield from Path(spec.origin).parent.glob(pattern)


def how_to_mend(packages: list[str]) -> str:
    """One line for the user."""
    return f"missing system libraries; on Debian: apt-get install {' '.join(packages)}"


if __name__ == "__main__":
    sys.exit(how_to_mend(found) if (found := missing()) else 0)
