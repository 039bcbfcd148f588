"""The rows of the benchmark, and the table in docs/performance.md.

python -m recipes.bench    # five minutes; nothing else should run meanwhile
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from evaps.report.summary import bench_table
from recipes.pages import put

ROWS = Path("results/bench.jsonl")
PAGE = Path("docs/performance.md")


def make_rows() -> None:
    """`evaps bench --out results/bench.jsonl`."""
    subprocess.run([Path(sys.executable).with_name("evaps"), "bench", "--out", ROWS], check=True)


def make_table() -> None:
    """The page's table, from the rows."""
    put(PAGE, str(ROWS), bench_table(ROWS))


if __name__ == "__main__":
    make_rows()
    make_table()
