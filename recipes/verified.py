"""Verified synthesis at the small scale: its rows, and the tables made of them.

    python -m recipes.verified   # everything, resuming where it was

Times are those of two cores without a graphics card.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from evaps.domain import CHOSEN
from evaps.metrics import Results, Row
from evaps.models import needed_for
from evaps.report import SEARCHED
from evaps.report.answers import answer_table, budget_table, confidence_table, noise_table, steps_table
from evaps.report.names import name_of
from evaps.report.summary import summary_table
from evaps.report.table import markdown_cells
from evaps.tasks.dataset import Dataset
from evaps.tasks.task import EXAMPLES
from recipes.command import start
from recipes.pages import put
from recipes.paper import NOISE, Plan, judge, make_checkpoint, make_data, with_what_is_needed
from recipes.result import read_result, write_result

PLAN = Plan()
RESULTS = PLAN.results
METHODS = RESULTS / "methods"
ROWS = METHODS / SEARCHED / "verified.parquet"
BLIND = METHODS / SEARCHED / "blind.parquet"
BLIND_TASKS = 200  # eight seconds each
PARTS = RESULTS / "verified-parts.parquet"
PART_TASKS = 40
MISSING = RESULTS / "verified-missing.json"
NOISY = RESULTS / "verified-noise"
NOISY_TASKS = 100
LARGER_OR_LONGER = {
    scale: RESULTS / "verified-models" / f"verified-{scale}.parquet" for scale in ("quick", PLAN.scale)
}
ACTIONS, SECONDS = (10, 100, 300, 1_000, 3_000, 10_000), (0.1, 1.0, 10.0)
COMPARED_TASKS, PATIENCE = 100, 14_000  # with as many actions as four searches may simulate
WITHOUT = (
    "verified",
    "verified-no-guide",
    "verified-no-sharing",
    "verified-no-beam",
    "verified-with-repairs",
    "enumeration",
)


def make_rows() -> None:
    """`evaps evaluate --methods verified`, with one part left out, and with noise: 15 minutes each.

    Then blind search with the same budget (a quarter of an hour), a guide of less data, and a larger budget:
    what is worth more?
    """
    runs, verified = PLAN.runs(0), ("verified",)
    judge(PLAN, runs, verified, ROWS)
    judge(replace(PLAN, tasks=BLIND_TASKS), runs, ("blind",), BLIND)
    count_missing()
    judge(replace(PLAN, tasks=PART_TASKS), runs, WITHOUT, PARTS)
    for share in (0.0, *NOISE):
        noisy = NOISY / f"verified-{100 * share:.0f}.parquet"
        judge(replace(PLAN, tasks=NOISY_TASKS), runs, verified, noisy, share)
    for scale, path in LARGER_OR_LONGER.items():
        models = make_models(scale)
        judge(replace(PLAN, tasks=COMPARED_TASKS), models, verified, path, actions=PATIENCE)


def make_models(scale: str) -> Path:
    """The folder of the checkpoints that the search uses; at another scale only its guide is another."""
    plan = replace(PLAN, scale=scale)
    make_data(plan)
    for method in needed_for("verified"):
        if plan != PLAN and method != "inverse":
            shutil.copytree(PLAN.runs(0) / method, plan.runs(0) / method, dirs_exist_ok=True)
        make_checkpoint(plan, 0, method)
    return plan.runs(0)


def count_missing() -> None:
    """What became of the tasks, by what the hidden programs have: these come from the data set alone."""
    programs = {row["index"]: row["program"] for row in Dataset(PLAN.data).rows}
    counts: dict[str, list[int]] = {}
    for answer in Results.read(ROWS).first("verified").answers():
        passes, right = answer["pairs_passed"] == EXAMPLES, answer["generalization_state"]
        became = 0 if right else 1 if passes else 2
        for trait in _traits(programs[answer["task"]]):
            counts.setdefault(trait, [0, 0, 0])[became] += 1
    write_result(MISSING, dict(sorted(counts.items())))


def _traits(program: str) -> list[str]:
    tokens = program.split()
    conditions = sum(tokens.count(word) for word in ("IF", "IFELSE", "WHILE"))
    loops = [word for word in ("WHILE", "REPEAT") if word in tokens]
    return ["(all)", f"conditions: {conditions}", *(f"loops: {word}" for word in loops or ["none"])]


def missing_table() -> str:
    """Markdown: `count_missing`, in % of the tasks with such programs."""
    head = ["the hidden program has", "tasks", "generalizes", "passes all five, and is wrong", "not found"]
    rows = [
        [trait, str(sum(became)), *(f"{100 * n / sum(became):.1f} %" for n in became)]
        for trait, became in read_result(MISSING).items()
    ]
    return markdown_cells(head, rows)


def tables(methods: Results, verified: Results) -> str:
    """The tables of docs/verified.md, from rows in METHODS, in ROWS, and in files that are read here."""
    without = Results.read(PARTS)
    parts = [
        answer_table(methods, verified),
        "The first, the first five and the first twenty candidates, no two of which do the same (in %):",
        summary_table(verified),
        "By the steps of the task:",
        steps_table(verified, "verified"),
        "By what the hidden program has, which no method sees:",
        missing_table(),
        "Within a budget (passes all five / generalizes, in %) LGRL's candidates, looked at, EVAPS's repairs "
        "of them, which is the paper's loop, the search, and programs drawn from the prior until one passes:",
        budget_table(
            {
                **answers_of(methods, "lgrl", "evaps"),
                **answers_of(verified),
                **answers_of(Results.read(BLIND)),
            },
            ACTIONS,
            SECONDS,
        ),
        "Confidence, and how often answers of that confidence were right:",
        confidence_table(verified, "verified"),
        f"With one part left out, or one more, on the first {PART_TASKS} of these tasks:",
        answer_table(without),
        "The same within a budget:",
        budget_table(answers_of(without), ACTIONS, SECONDS),
        f"With noise, on the first {NOISY_TASKS}; goals are compared on pixels that are valid in both views:",
        noise_table(NOISY, "verified"),
        f"With a guide of less data, and other budgets, on the first {COMPARED_TASKS} (passes all five / "
        "generalizes):",
        budget_table(
            {
                f"guide of {scale} scale": Results.read(path).first("verified").answers()
                for scale, path in LARGER_OR_LONGER.items()
            },
            (300, 1_000, CHOSEN.budget, PATIENCE),
        ),
    ]
    return "\n\n".join(parts)


def answers_of(results: Results, *methods: str) -> dict[str, Sequence[Row]]:
    """The answers of some or all of the methods, by what they are called."""
    return {name_of(m): results.first(m).answers() for m in methods or results.methods}


def make_tables() -> None:
    """Put them into the page, and the first into README.md."""
    methods, verified = Results.read(METHODS), Results.read(ROWS)
    put(Path("docs/verified.md"), "verified", tables(methods, verified))
    put(Path("README.md"), "answers", answer_table(methods, verified))


def main() -> None:
    """All steps in order; each goes on where it was interrupted."""
    make_data(PLAN)
    for method in with_what_is_needed(WITHOUT):
        make_checkpoint(PLAN, 0, method)
    make_rows()
    make_tables()


if __name__ == "__main__":
    start(main)
