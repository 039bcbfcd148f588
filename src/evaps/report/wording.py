"""What may be said of results: of what scale they are, and where two methods differ for certain."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from evaps.bootstrap import Interval
from evaps.metrics import TOP, Results
from evaps.report.names import name_of
from evaps.report.paper import PAPER

GOAL = "generalization_state"
"""The metric that differences are told in."""


def mean_and_deviation(values: Sequence[float] | np.ndarray[tuple[int], np.dtype[np.float64]]) -> str:
    """Over seeds; one seed has no deviation. Nothing if there are not so many candidates."""
    if np.isnan(values).any():
        return ""
    mean = f"{np.mean(values):.1f}"
    return f"{mean} ± {np.std(values, ddof=1):.1f}" if len(values) > 1 else mean


def scale_note(results: Results) -> str:
    """One sentence that says of what scale our figures are, and of what scale the paper's."""
    runs = list(results.each())
    tasks = sorted({len(run.tasks) for run in runs})
    scales = sorted({str(run.fact("scale")) for run in runs})
    seeds = sorted({len(seeds) for seeds in results.by_method.values()})
    data = sorted({run.fact("trained_on") or 0 for run in runs} - {0})
    plural = "" if seeds == [1] else "s"
    splits = sorted({str(run.fact("split") or "test") for run in runs})
    ours = (
        f"{_range(tasks)} {', '.join(splits)} tasks, {_range(seeds)} seed{plural}, scale {', '.join(scales)}"
    )
    repaired = any(row.get("rounds") for run in runs for row in run.each())
    part = " (repairers on mistakes in a part of these)" if repaired else ""
    trained = f", trained on 70 % of {_range(data)} tasks{part}" if data else ""
    return f"Ours: {ours}{trained}. The paper: {PAPER}.{_what_few_seeds_say(seeds)}"


def _what_few_seeds_say(seeds: Sequence[int]) -> str:
    """A caveat for intervals, by the numbers of seeds."""
    once = "Of one seed intervals are over test tasks, and say nothing about training again."
    few = "Two to four seeds say little of how much seeds differ: intervals over them are rough."
    said = [once] * (1 in seeds) + [few] * any(1 < count < 5 for count in seeds)
    return "".join(f" {sentence}" for sentence in said)


def sentences(
    results: Results, better: str, others: Sequence[str], ks: Sequence[int] = (min(TOP), max(TOP))
) -> Iterator[str]:
    """A sentence for each other method; it claims a difference only where the interval does."""
    for other in others if better in results.methods else ():
        try:
            found = results.differences(better, other, GOAL, ks)
        except ValueError:  # not judged on the same tasks with the same seeds
            continue
        each = [said(interval, f" at generalization @{k}") for k, interval in zip(ks, found, strict=True)]
        seeds = seeds_of(results, better, other)
        yield f"{name_of(better)} against {name_of(other)} ({seeds}): {'; '.join(each)}."


def seeds_of(results: Results, one: str, other: str) -> str:
    """How many seeds two methods are compared on."""
    shared = len(results.shared_seeds(one, other))
    return "one seed" if shared == 1 else f"{shared} seeds"


def said(found: Interval, at: str = "") -> str:
    """What may be said of a difference in points: it is claimed only where the interval is clear of zero.

    Args:
        found: the difference.
        at: at what.
    """
    verdict = "not certainly different"
    if found.certain:
        verdict = "better" if found.mean > 0 else "worse"
    return f"{verdict}{at}, {found.mean:+.1f} points, 95 % interval [{found.low:+.1f}, {found.high:+.1f}]"


def _range(numbers: Sequence[int]) -> str:
    low, high = min(numbers), max(numbers)
    return f"{low:,}" if low == high else f"{low:,} to {high:,}"
