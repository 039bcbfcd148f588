"""Tables from evaluation rows."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

from evaps.metrics import METRICS, TOP, answer_rows, paired_difference, summarize
from evaps.tasks.info import STEP_BUCKETS
from evaps.tasks.task import EXAMPLES

NAMES = {
    "lgrl": "LGRL",
    "evaps": "EVAPS (repairs LGRL's candidates)",
    "verified": "verified synthesis",
    "verified-no-guide": "without the inverse model",
    "verified-no-sharing": "without sharing among scenes",
    "verified-no-beam": "without LGRL's beam",
    "enumeration": "enumeration of programs by cost",
    "blind": "blind: programs drawn from the prior",
}
TITLES = {"exact": "exact", "semantic_state": "semantic", "generalization_state": "generalization"}


def summary_table(rows: Path) -> str:
    """Markdown: for each method the metrics at top-1 / 5 / 20 and its answer in %, and its cost a task."""
    head = ["method", *(TITLES[m] for m in METRICS), "answer", "seconds", "simulated actions"]
    lines = [f"| {' | '.join(head)} |", f"|---{'|---:' * (len(head) - 1)}|"]
    for line in summarize(rows):
        matches = [" / ".join(f"{line[f'{metric}@{k}']:.1f}" for k in TOP) for metric in METRICS]
        costs = [f"{line['answer']:.1f}", f"{line['seconds']:.2f}", f"{line['simulated_actions']:.0f}"]
        lines.append(f"| {' | '.join([NAMES.get(line['method'], line['method']), *matches, *costs])} |")
    return "\n".join(lines)


def difference_line(rows: Path, better: str = "evaps", worse: str = "lgrl") -> str:
    """One sentence: how much better the first method's first answer generalizes, with its interval."""
    mean, low, high = paired_difference(rows, better, worse, "generalization_state", 1)
    return (
        f"Generalization at top-1, {NAMES[better].split(' (')[0]} minus {NAMES[worse]}: {mean:+.1f} points, "
        f"95 % interval [{low:+.1f}, {high:+.1f}] (paired bootstrap over tasks)."
    )


def answer_table(rows: Sequence[Path]) -> str:
    """Markdown: the one answer of each method that the files have rows of, and what it has cost."""
    head = [
        "method",
        "tasks",
        "passes all five",
        "generalizes",
        "seconds, median",
        "95 %",
        "actions, median",
        "95 %",
    ]
    lines = [f"| {' | '.join(head)} |", f"|---{'|---:' * (len(head) - 1)}|"]
    for path in rows:
        for method in dict.fromkeys(pq.read_table(path, columns=["method"])["method"].to_pylist()):
            answers = list(answer_rows(path, method).values())
            solved = [row["pairs_passed"] == EXAMPLES for row in answers]
            right = [row["generalization_state"] for row in answers]
            seconds = np.percentile([row["seconds"] for row in answers], [50, 95])
            actions = np.percentile([row["simulated_actions"] for row in answers], [50, 95])
            cells = [f"{100 * np.mean(x):.1f} %" for x in (solved, right)]
            cells += [f"{x:.2f}" for x in seconds] + [f"{x:.0f}" for x in actions]
            lines.append(f"| {' | '.join([NAMES.get(method, method), str(len(answers)), *cells])} |")
    return "\n".join(lines)


def steps_table(rows: Path, method: str) -> str:
    """Markdown: how often a method's answer passes and generalizes, by the steps of the task."""
    answers = list(answer_rows(rows, method).values())
    lines = ["| steps | tasks | passes all five | generalizes |", "|---|---:|---:|---:|"]
    for bucket, name in enumerate(STEP_BUCKETS):
        there = [row for row in answers if min(row["steps"], 7) - 2 == bucket]
        shares = _shares(there)
        lines.append(f"| {name} | {len(there)} | {shares[0]} | {shares[1]} |")
    return "\n".join(lines)


def budget_table(rows: Path, method: str) -> str:
    """Markdown: the share of tasks with an answer that passes all five, and generalizes, within a budget."""
    answers = list(answer_rows(rows, method).values())
    lines = ["| within | passes all five | generalizes |", "|---|---:|---:|"]
    limits: list[tuple[str, float, str]] = [
        *(("simulated_actions", n, f"{n:,} actions") for n in (30, 100, 300, 1_000, 3_000, 10_000)),
        *(("seconds", s, f"{s:g} s") for s in (0.2, 0.5, 1.0, 3.0, 10.0)),
    ]
    for key, limit, name in limits:
        in_time = [row["pairs_passed"] == EXAMPLES and row[key] <= limit for row in answers]
        right = [there and row["generalization_state"] for there, row in zip(in_time, answers, strict=True)]
        lines.append(f"| {name} | {100 * np.mean(in_time):.1f} % | {100 * np.mean(right):.1f} % |")
    return "\n".join(lines)


def confidence_table(rows: Path, method: str) -> str:
    """Markdown: how often answers of a confidence generalize, of those that pass all five."""
    answers = [r for r in answer_rows(rows, method).values() if r["pairs_passed"] == EXAMPLES]
    lines = ["| confidence | answers | generalize |", "|---|---:|---:|"]
    for low, high in ((0.0, 0.5), (0.5, 0.7), (0.7, 0.9), (0.9, 1.0), (1.0, 1.1)):
        there = [row for row in answers if low <= row["confidence"] + 1e-6 < high]
        name = "1" if low == 1.0 else f"{low} to {high}"
        lines.append(f"| {name} | {len(there)} | {_shares(there)[1]} |")
    return "\n".join(lines)


def _shares(answers: Sequence[Mapping[str, Any]]) -> tuple[str, str]:
    """Of the answers those that pass all five, and those that generalize; in %."""
    if not answers:
        return "", ""
    solved = np.mean([row["pairs_passed"] == EXAMPLES for row in answers])
    return f"{100 * solved:.1f} %", f"{100 * np.mean([row['generalization_state'] for row in answers]):.1f} %"


def bench_table(rows: Path) -> str:
    """The figures of ``evaps bench`` as Markdown, from the file that its ``--out`` wrote."""
    figures = [json.loads(line) for line in rows.read_text().splitlines()]
    lines = [f"| {f['name']} | {f['value']:.4g} {f['unit']} | {f['target']} |" for f in figures]
    return "\n".join(["| what | measured | target |", "|---|---:|---:|", *lines])
