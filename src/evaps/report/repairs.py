"""What repair does to candidates: round by round, for better and for worse, and token by token."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Bool

from evaps.bootstrap import bootstrap, bootstraps
from evaps.dsl import token_type
from evaps.dsl.alignment import align
from evaps.metrics import TOP, MethodResults, Results, Row, attempt_after
from evaps.report.figure import Figure, Line
from evaps.report.names import name_of
from evaps.report.table import Table
from evaps.report.wording import said, scale_note, seeds_of

MOST_EDITS = 25
NAIVE = "naive"
"""Who repairs without seeing what happened."""


def rounds(results: Results) -> Figure:
    """Generalization against the rounds of repair, with 95 % intervals."""
    panels: dict[str, dict[str, Line]] = {f"top-{k}": {} for k in TOP}
    for method in repairers(results):
        runs = results.by_method[method]
        each = range(max(row["rounds"] for run in runs for row in run.each()) + 1)
        for k in TOP:
            found = bootstraps(np.array([[100.0 * _after(run, n, k) for run in runs] for n in each]))
            means, lows, highs = zip(*found, strict=True)
            panels[f"top-{k}"][name_of(method)] = Line(each, means, lows, highs)
    notes = list(_ahead_after(1, results)) if NAIVE in results.methods else []
    return Figure(panels, "rounds of repair", "generalization (%)", notes=notes)


def _after(run: MethodResults, rounds: int, k: int) -> Bool[np.ndarray, " task"]:
    """For each task whether one of the first ``k`` candidates generalizes after some rounds."""
    right = [
        any(attempt_after(r, rounds)["generalization_state"] for r in run.first(t, k)) for t in run.tasks
    ]
    return np.array(right)


def _ahead_after(rounds: int, results: Results) -> Iterator[str]:
    """What is gained by seeing what happened, when each candidate was repaired so often."""
    for method in repairers(results):
        if method == NAIVE or not results.shared_seeds(method, NAIVE):
            continue
        try:
            gains = results.gains(method, NAIVE, lambda run: _after(run, rounds, 1))
        except ValueError:  # not judged on the same tasks
            continue
        names = f"{name_of(method)} against {name_of(NAIVE)} ({seeds_of(results, method, NAIVE)})"
        yield f"{names}, after {rounds} round of repair: {said(bootstrap(gains), ' at generalization @1')}."


def effects(results: Results) -> Table:
    """Of all candidates: wrong before and right after, right and wrong, and those that were left alone.

    Right is who generalizes. The last attempt counts, as in the paper's protocol.
    """
    head = [
        "method",
        "candidates",
        "wrong to right",
        "right to wrong",
        "right kept",
        "wrong kept",
        "untouched",
    ]
    rows = []
    for method in repairers(results):
        pairs = [(row["attempts"][0], row["attempts"][-1]) for row in rows_of(results, method)]
        right = Counter((a["generalization_state"], b["generalization_state"]) for a, b in pairs)
        untouched = sum(a["program"] == b["program"] for a, b in pairs)
        counts = [right[False, True], right[True, False], right[True, True], right[False, False], untouched]
        shares = [f"{100 * n / len(pairs):.2f} %" for n in counts]
        rows.append([name_of(method), f"{len(pairs):,}", *shares])
    notes = [
        "A candidate that passes all five examples is not repaired, and is among the untouched.",
        scale_note(results),
    ]
    return Table("What repair fixes and what it breaks", head, rows, notes)


def edits(results: Results) -> list[Table]:
    """For each repairer what was written in the place of what, by kinds of tokens and by tokens."""
    made = [table for method in repairers(results) for table in _edits(results, method)]
    return [*made[:-1], *(replace(table, notes=[scale_note(results)]) for table in made[-1:])]


def _edits(results: Results, method: str) -> Iterator[Table]:
    kinds: Counter[tuple[str, str]] = Counter()
    tokens: Counter[tuple[str, str]] = Counter()
    fixed: Counter[tuple[str, str]] = Counter()
    for row in rows_of(results, method):
        first, last = row["attempts"][0], row["attempts"][-1]
        if first["program"] == last["program"]:
            continue
        before, after = (x["program"].split() for x in (first, last))  # rows have the canonical form
        for edit in align(before, after):
            if edit.kind != "keep":
                kinds[_kind(edit.old), _kind(edit.new)] += 1
                tokens[edit.old or "", edit.new or ""] += 1
                fixed[edit.old or "", edit.new or ""] += last["generalization_state"]
    names = list(dict.fromkeys(kind for pair in kinds for kind in pair))
    yield Table(
        f"{name_of(method)}: kinds of tokens before (rows) and after (columns) repair",
        ["", *names],
        [[old, *(f"{kinds[old, new]:,}" if kinds[old, new] else "" for new in names)] for old in names],
        ["`nothing` before is an insertion, `nothing` after a deletion."],
    )
    most = sorted(tokens, key=lambda pair: (-tokens[pair], pair))[:MOST_EDITS]
    rows = [
        [f"{o or 'nothing'} to {n or 'nothing'}", f"{tokens[o, n]:,}", _share(fixed[o, n], tokens[o, n])]
        for o, n in most
    ]
    yield Table(
        f"{name_of(method)}: the most frequent edits",
        ["edit", "times", "in programs that generalize"],
        rows,
    )


def _kind(token: str | None) -> str:
    return "nothing" if token is None else str(token_type(token))


def _share(part: int, of: int) -> str:
    return f"{100 * part / of:.1f} %"


def repairers(results: Results) -> list[str]:
    """The methods of which some candidate was repaired."""
    return [
        m for m in results.methods if any(row["rounds"] and row["attempts"] for row in rows_of(results, m))
    ]


def rows_of(results: Results, method: str) -> Iterator[Row]:
    """All rows of a method."""
    for run in results.by_method[method]:
        yield from run.each()
