"""Tables that the paper does not have: strict matches, every two methods, and what looking is worth."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from evaps.bootstrap import bootstrap
from evaps.metrics import TOP, Results, among_first, answered_among
from evaps.report.names import name_of
from evaps.report.table import Table
from evaps.report.tables import BEFORE, TABLE_1, TABLE_2
from evaps.report.wording import GOAL, mean_and_deviation, said, scale_note, seeds_of

CHECKED = (1, 2, 3, 6, 20)  # candidates; for its first one a repairer runs six programs in five rounds


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
    """What as many of the synthesizer's candidates are worth as a repairer runs at most for its first one."""
    there = [m for m in TABLE_2 if m in results.methods]
    for method in there[1:] if BEFORE in there else ():
        few = max(run.most_attempts for run in results.by_method[method])
        try:
            gains = results.gains(BEFORE, method, answered_among(few), among_first(GOAL, 1))
        except ValueError:  # not judged on the same tasks with the same seeds
            continue
        yield (
            f"Of the first {few} candidates of {name_of(BEFORE)} the one that passes most, against the first "
            f"of {name_of(method)} ({seeds_of(results, BEFORE, method)}): {said(bootstrap(gains))}."
        )
