"""Which candidates are mended: by how many tokens they are from the program that was meant.

    python -m recipes.distances   # results/small/distances.json, a table in docs/findings.md; needs the data

A candidate's distance is the least number of tokens to replace, insert and delete until it is the gold
program. Whether edits fit together matters only where more than one is missing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

from evaps.dsl.alignment import align
from evaps.metrics import MethodResults, Results, Row, attempt_after
from evaps.report.names import name_of
from evaps.report.repairs import repairers
from evaps.report.table import Table
from evaps.tasks.dataset import Dataset
from evaps.tasks.progress import track
from recipes.command import start
from recipes.pages import put
from recipes.paper import Plan, make_data
from recipes.result import write_result

BUCKETS = (1, 2, 3, 5, 9)
"""The first distance in each."""
WHEN: dict[str, Callable[[Row], Row]] = {
    "one round": lambda row: attempt_after(row, 1),
    "all rounds": lambda row: row["attempts"][-1],
}


def mended(runs: list[MethodResults], golds: dict[int, list[str]]) -> list[dict[str, float]]:
    """For each bucket how many wrong candidates there are, and which share is right after repair, in %."""
    found: Counter[tuple[int, str]] = Counter()
    rows = [row for run in runs for row in run.each()]
    for row in track(rows, len(rows), runs[0].method, 0, 1_000):
        first = row["attempts"][0]
        if first["generalization_state"]:
            continue
        distance = sum(edit.kind != "keep" for edit in align(first["program"].split(), golds[row["task"]]))
        bucket = max(start for start in BUCKETS if start <= max(1, distance))
        found[bucket, "candidates"] += 1
        for when, attempt in WHEN.items():
            found[bucket, when] += attempt(row)["generalization_state"]
    return [
        {
            "from": start,
            "candidates": found[start, "candidates"],
            **{
                when: round(100 * found[start, when] / max(1, found[start, "candidates"]), 1) for when in WHEN
            },
        }
        for start in BUCKETS
    ]


def table_of(found: dict[str, list[dict[str, float]]]) -> Table:
    """A row for each repairer, a column for each bucket."""
    ends = [f" to {end - 1}" if end - start > 1 else "" for start, end in pairwise(BUCKETS)]
    head = ["method", *(f"{start}{end}" for start, end in zip(BUCKETS, [*ends, " and more"], strict=True))]
    rows = [
        [name_of(method), *(" / ".join(f"{bucket[when]:.1f}" for when in WHEN) for bucket in buckets)]
        for method, buckets in found.items()
    ]
    counts = [f"{bucket['candidates']:,}" for bucket in found["evaps"]]
    title = (
        f"Wrong candidates that are right after {' / '.join(WHEN)} of repair, in %, by the tokens that differ"
    )
    return Table(title, head, [*rows, ["wrong candidates of EVAPS", *counts]])


def main() -> None:
    """Count, and write what was found."""
    plan = Plan()
    make_data(plan)
    rows = Dataset(plan.data).rows
    golds = {i: p.split() for i, p in zip(rows.column("index"), rows.column("program"), strict=True)}
    results = Results.read(plan.results / "methods")
    found = {method: mended(results.by_method[method], golds) for method in repairers(results)}
    write_result(plan.results / "distances.json", found)
    put(Path("docs/findings.md"), "distances", table_of(found).markdown().strip())


if __name__ == "__main__":
    start(main)
