"""Verified synthesis at the small scale: its rows, and the tables made of them.

    python -m recipes.verified   # everything, resuming where it was

Times are those of two cores without a graphics card.
"""

from __future__ import annotations

from pathlib import Path

from evaps.evaluate import evaluate
from evaps.models import needed_for
from evaps.report.summary import (
    answer_table,
    budget_table,
    confidence_table,
    noise_table,
    steps_table,
    summary_table,
)
from recipes.pages import put
from recipes.paper import NOISE, Plan, make_checkpoint, make_data

PLAN = Plan()
RESULTS = PLAN.results
METHODS = RESULTS / "methods"
ROWS = RESULTS / "verified.parquet"
PARTS = RESULTS / "verified-parts.parquet"
PART_TASKS = 40
NOISY = RESULTS / "verified-noise"
NOISY_TASKS = 100
WITHOUT = (
    "verified",
    "verified-no-guide",
    "verified-no-sharing",
    "verified-no-beam",
    "verified-with-repairs",
    "enumeration",
    "blind",
)


def make_rows() -> None:
    """`evaps evaluate --methods verified`, with one part left out, and with noise: 15 minutes each."""
    evaluate(PLAN.data, ROWS, str(PLAN.runs(0)), ("verified",), tasks=PLAN.tasks)
    evaluate(PLAN.data, PARTS, str(PLAN.runs(0)), WITHOUT, tasks=PART_TASKS)
    for share in (0.0, *NOISE):
        path = NOISY / f"verified-{100 * share:.0f}.parquet"
        path.parent.mkdir(exist_ok=True)
        evaluate(PLAN.data, path, str(PLAN.runs(0)), ("verified",), tasks=NOISY_TASKS, noise=share)


def tables() -> str:
    """The tables of docs/verified.md, from the rows."""
    parts = [
        answer_table([METHODS, ROWS]),
        "The first, the first five and the first twenty candidates, no two of which do the same (in %):",
        summary_table(ROWS),
        "By the steps of the task:",
        steps_table(ROWS, "verified"),
        "Within a budget of simulated actions, or of seconds:",
        budget_table(ROWS, "verified"),
        "Confidence, and how often answers of that confidence were right:",
        confidence_table(ROWS, "verified"),
        f"With one part left out, or one more, on the first {PART_TASKS} of these tasks:",
        answer_table([PARTS]),
        f"With noise, on the first {NOISY_TASKS}; goals are compared on pixels that are valid in both views:",
        noise_table(NOISY, "verified"),
    ]
    return "\n\n".join(parts)


def make_tables() -> None:
    """Put them into the page, and the first into README.md."""
    put(Path("docs/verified.md"), "verified", tables())
    put(Path("README.md"), "answers", answer_table([METHODS, ROWS]))


def main() -> None:
    """All steps in order; each goes on where it was interrupted."""
    make_data(PLAN)
    for method in needed_for("verified"):
        make_checkpoint(PLAN, 0, method)
    make_rows()
    make_tables()


if __name__ == "__main__":
    main()
