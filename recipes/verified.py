"""Verified synthesis at the small scale: its inverse model, its rows, and the tables made of them.

    python -m recipes.verified            # everything, resuming where it was
    python -m recipes.verified --retrain  # not from the shipped inverse model

Times are those of two cores without a graphics card. The encoder is the shipped one.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from evaps.evaluate import evaluate
from evaps.models import SHIPPED
from evaps.report import answer_table, budget_table, confidence_table, steps_table, summary_table
from evaps.train import train
from recipes.pages import put
from recipes.small import DATA, RUNS, SEED, TEST_TASKS, make_data, ship
from recipes.small import ROWS as SMALL_ROWS

RESULTS = Path("results/small")
ROWS = RESULTS / "verified.parquet"
PARTS = RESULTS / "verified-parts.parquet"
PART_TASKS = 40
WITHOUT = ("verified", "verified-no-guide", "verified-no-sharing", "verified-no-beam", "enumeration", "blind")


def make_checkpoint() -> None:
    """`evaps train inverse --data data/small --out runs/small` on the shipped encoder: 20 minutes."""
    shutil.copytree(SHIPPED / "small" / "encoder", RUNS / "encoder", dirs_exist_ok=True)
    train("inverse", DATA, RUNS, "small", SEED)
    ship("inverse")


def make_rows() -> None:
    """`evaps evaluate --methods verified`, and with one part left out: 15 minutes each."""
    evaluate(DATA, ROWS, "small", ("verified",), tasks=TEST_TASKS)
    evaluate(DATA, PARTS, "small", WITHOUT, tasks=PART_TASKS)


def tables() -> str:
    """The tables of docs/verified.md, from the rows."""
    parts = [
        answer_table([SMALL_ROWS, ROWS]),
        "The first, the first five and the first twenty candidates, no two of which do the same (in %):",
        summary_table(ROWS),
        "By the steps of the task:",
        steps_table(ROWS, "verified"),
        "Within a budget of simulated actions, or of seconds:",
        budget_table(ROWS, "verified"),
        "Confidence, and how often answers of that confidence were right:",
        confidence_table(ROWS, "verified"),
        f"With one part left out, on the first {PART_TASKS} of these tasks:",
        answer_table([PARTS]),
    ]
    return "\n\n".join(parts)


def make_tables() -> None:
    """Put them into the page, and the first into README.md."""
    put(Path("docs/verified.md"), "verified", tables())
    put(Path("README.md"), "answers", answer_table([SMALL_ROWS, ROWS]))


def main() -> None:
    """All steps in order; each goes on where it was interrupted."""
    make_data()
    if "--retrain" in sys.argv or not (SHIPPED / "small" / "inverse").is_dir():
        make_checkpoint()
    make_rows()
    make_tables()


if __name__ == "__main__":
    main()
