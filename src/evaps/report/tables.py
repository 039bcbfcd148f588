"""The paper's two tables from our rows, with the published numbers beside ours."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from evaps.bootstrap import Interval, bootstrap
from evaps.metrics import METRICS, TITLES, TOP, Results
from evaps.report.names import NAMES, name_of
from evaps.report.paper import GENERALIZATION, PAPER, PUBLISHED
from evaps.report.table import Table

BEFORE = "lgrl"
"""Whose candidates the repairers of these tables mend."""
TABLE_2 = (BEFORE, "naive", "evaps-o", "evaps-s", "evaps")
TABLE_1 = (BEFORE, "lgrl-rl", "sed", "inferred-trace", "latent-execution", "transformer", *TABLE_2[1:])
CHECKED = (1, 2, 3, 6, 20)  # candidates; a repairer runs about six programs for its first one
GOAL = "generalization_state"


def table_1(results: Results) -> Table:
    """The methods against each other: three metrics, top-1, top-5 and top-20."""
    own = [m for m in results.methods if m not in NAMES]  # methods of other packages
    methods = [m for m in (*TABLE_1, *own) if m in results.methods]
    head = ["method", *(f"{TITLES[m]} @{k}" for m in METRICS for k in TOP), "seeds"]
    rows = []
    for method in methods:
        cells = [
            mean_and_deviation(results.top(method, m, k)) + _published(m, method, i)
            for m in METRICS
            for i, k in enumerate(TOP)
        ]
        rows.append([name_of(method), *cells, str(len(results.by_method[method]))])
    others = [m for m in methods if m != "evaps"]
    notes = [scale_note(results), *sentences(results, "evaps", others)]
    return Table("Methods, in % of the tasks; the paper's in brackets", head, rows, notes, number=1)


def table_2(results: Results) -> Table:
    """The ablation: what is gained without observations (S), without the graph (O), and with both."""
    methods = [m for m in TABLE_2 if m in results.methods]
    head = ["method", *(f"generalization @{k}" for k in TOP), *(f"gain @{k}" for k in TOP), "seeds"]
    base = next((m for m in ("naive", BEFORE) if m in methods), None)
    rows = []
    for method in methods:
        cells = [
            mean_and_deviation(results.top(method, GOAL, k)) + _published(GOAL, method, i)
            for i, k in enumerate(TOP)
        ]
        gains = [_gain(results, method, base, k) if base else "" for k in TOP]
        name = "candidates before repair (LGRL)" if method == BEFORE else name_of(method)
        rows.append([name, *cells, *gains, str(len(results.by_method[method]))])
    notes = [scale_note(results), *sentences(results, "evaps", [m for m in methods if m != "evaps"])]
    if base:
        notes.insert(
            1,
            f"Gains are over {name_of(base)}, in points, over the seeds that both have, with 95 % intervals.",
        )
    return Table("What the parts of EVAPS add; the paper's in brackets", head, rows, notes, number=2)


def frames(results: Results) -> Table:
    """The strict match, byte for byte in every view, beside the match of states."""
    pairs = [("semantic_state", "semantic_frame"), ("generalization_state", "generalization_frame")]
    head = ["method", *(f"{m.replace('_', ' ')} @{k}" for pair in pairs for m in pair for k in TOP)]
    rows = [
        [
            name_of(method),
            *(mean_and_deviation(results.top(method, m, k)) for pair in pairs for m in pair for k in TOP),
        ]
        for method in results.methods
    ]
    return Table("Matches of states and of frames, in % of the tasks", head, rows, [scale_note(results)])


def differences(results: Results) -> Table:
    """Every two methods: by how many points the first is ahead among the first 1, 5 and 20 candidates."""
    order = {method: place for place, method in enumerate(reversed(TABLE_1))}
    methods = sorted(results.methods, key=lambda method: order.get(method, len(order)))
    rows = []
    for one, other in combinations(methods, 2):
        try:
            found = results.differences(one, other, GOAL)
        except ValueError:  # not judged on the same tasks with the same seeds
            continue
        seeds = len(results.shared_seeds(one, other))
        cells = [f"{interval} *" if interval.certain else str(interval) for interval in found]
        rows.append([name_of(one), name_of(other), *cells, str(seeds)])
    head = ["method", "against", *(f"@{k}" for k in TOP), "seeds"]
    chance = (
        f"{len(TOP) * len(rows)} intervals of 95 % are shown, those that leave out zero with a star: "
        "where nothing differs one in twenty does, too."
    )
    title = "Differences in generalization, in points"
    return Table(title, head, rows, [scale_note(results), chance])


def checked(results: Results) -> Table:
    """What it is worth to run the first candidates and hand out the one that passes most examples."""
    head = ["method", *(f"of the first {k}" for k in CHECKED)]
    rows = []
    for method, runs in results.by_method.items():
        cells = []
        for k in CHECKED:
            shares = [100 * run.answered(k).mean() for run in runs]
            cells.append(
                f"{mean_and_deviation(shares)} ({np.mean([run.programs_run(k) for run in runs]):.1f})"
            )
        rows.append([name_of(method), *cells])
    title = "Generalization of the candidate that passes most examples, in % (and the programs that were run)"
    return Table(title, head, rows, [scale_note(results), *_as_many_looked_at(results)])


def _as_many_looked_at(results: Results) -> Iterator[str]:
    """A repairer runs about six programs for its first candidate: what six of its synthesizer's are worth."""
    few = 6
    for method in (m for m in TABLE_2 if m in results.methods and m != BEFORE):
        try:
            gains = results.gains(
                BEFORE, method, lambda run: run.answered(few), lambda run: run.matches(GOAL, 1)
            )
        except (KeyError, ValueError):  # not judged on the same tasks, or not at all
            continue
        yield (
            f"Of the first {few} candidates of {name_of(BEFORE)} the one that passes most, against the first "
            f"of {name_of(method)} ({seeds_of(results, BEFORE, method)}): {said(bootstrap(gains))}."
        )


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
    """What may be said of a difference in points: it is claimed only where the interval leaves out zero.

    Args:
        found: the difference.
        at: at what.
    """
    verdict = "not certainly different"
    if found.certain:
        verdict = "better" if found.mean > 0 else "worse"
    return f"{verdict}{at}, {found.mean:+.1f} points, 95 % interval [{found.low:+.1f}, {found.high:+.1f}]"


def _gain(results: Results, method: str, base: str, k: int) -> str:
    if method == base:
        return ""
    try:
        found = results.difference(method, base, GOAL, k)
    except ValueError:  # not judged on the same tasks
        return ""
    paper = ""
    if method in GENERALIZATION and base in GENERALIZATION:
        i = TOP.index(k)
        paper = f" ({GENERALIZATION[method][i] - GENERALIZATION[base][i]:+.1f})"
    return f"{found}{paper}"


def _published(metric: str, method: str, i: int) -> str:
    found = PUBLISHED[metric].get(method)
    return "" if found is None else f" ({found[i]:.1f})"


def _range(numbers: Sequence[int]) -> str:
    low, high = min(numbers), max(numbers)
    return f"{low:,}" if low == high else f"{low:,} to {high:,}"
