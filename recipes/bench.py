"""The rows of the benchmark, and the table in docs/performance.md.

python -m recipes.bench    # five minutes; nothing else should run meanwhile
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from evaps.report import bench_table

ROWS = Path("results/bench.jsonl")
PAGE = Path("docs/performance.md")


def make_rows() -> None:
    """`evaps bench --out results/bench.jsonl`."""
    subprocess.run([Path(sys.executable).with_name("evaps"), "bench", "--out", ROWS], check=True)


def make_table() -> None:
    """The page's table, from the rows."""
    before, mark, rest = PAGE.read_text().partition(f"<!-- {ROWS} -->\n")
    after = rest.partition("<!-- end -->")[2]
    PAGE.write_text(f"{before}{mark}{bench_table(ROWS)}\n<!-- end -->{after}")


if __name__ == "__main__":
    make_rows()
    make_table()
