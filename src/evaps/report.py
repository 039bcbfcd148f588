"""Tables from evaluation rows."""

from __future__ import annotations

import json
from pathlib import Path

from evaps.metrics import METRICS, TOP, paired_difference, summarize

NAMES = {"lgrl": "LGRL", "evaps": "EVAPS (repairs LGRL's candidates)"}
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


def bench_table(rows: Path) -> str:
    """The figures of ``evaps bench`` as Markdown, from the file that its ``--out`` wrote."""
    figures = [json.loads(line) for line in rows.read_text().splitlines()]
    lines = [f"| {f['name']} | {f['value']:.4g} {f['unit']} | {f['target']} |" for f in figures]
    return "\n".join(["| what | measured | target |", "|---|---:|---:|", *lines])
