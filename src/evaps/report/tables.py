"""The paper's two tables from our rows, with the published numbers beside ours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evaps.bootstrap import Interval
from evaps.metrics import METRICS, TITLES, TOP, Results
from evaps.report.dots import Dot, DotPlot, Panel
from evaps.report.names import NAMES, name_of
from evaps.report.paper import PUBLISHED
from evaps.report.table import Table
from evaps.report.wording import GOAL, mean_and_deviation, scale_note, sentences

BEFORE = "lgrl"
"""Whose candidates the repairers of these tables mend."""
TABLE_2 = (BEFORE, "naive", "evaps-o", "evaps-s", "evaps")
TABLE_1 = (BEFORE, "lgrl-rl", "sed", "inferred-trace", "latent-execution", "transformer", *TABLE_2[1:])
SERIES = [f"top-{k}" for k in TOP]
NAIVE = (
    "Naive repairs, but blindly; the paper's may be meant as what there is before repair (docs/findings.md)."
)
SHARE = "% of the tasks ± deviation over seeds"


def table_1(results: Results) -> Table:
    """The methods against each other: three metrics, top-1, top-5 and top-20."""
    own = [m for m in results.methods if m not in NAMES]  # methods of other packages
    methods = [m for m in (*TABLE_1, *own) if m in results.methods]
    head = ["method", *(f"{TITLES[m]} @{k}" for m in METRICS for k in TOP), "seeds"]
    rows = [
        [
            name_of(method),
            *(_cell(results, method, metric, k) for metric in METRICS for k in TOP),
            str(len(results.by_method[method])),
        ]
        for method in methods
    ]
    others = [m for m in methods if m != "evaps"]
    notes = [*_on(results, methods), *sentences(results, "evaps", others)]
    title = "Methods, in % of the tasks; the paper's in brackets"
    panels = [
        Panel(
            TITLES[metric], SHARE, {name_of(m): [_dot(results, m, metric, k) for k in TOP] for m in methods}
        )
        for metric in METRICS
    ]
    return Table(title, head, rows, notes, number=1, picture=DotPlot(panels, SERIES))


def table_2(results: Results) -> Table:
    """The ablation: what is gained without observations (S), without the graph (O), and with both."""
    methods = [m for m in TABLE_2 if m in results.methods]
    names = {m: "candidates before repair (LGRL)" if m == BEFORE else name_of(m) for m in methods}
    head = ["method", *(f"generalization @{k}" for k in TOP), *(f"gain @{k}" for k in TOP), "seeds"]
    base = next((m for m in ("naive", BEFORE) if m in methods), None)
    gains = {m: [_gain(results, m, base, k) for k in TOP] for m in methods}
    rows = [
        [
            names[method],
            *(_cell(results, method, GOAL, k) for k in TOP),
            *("" if gain is None else str(gain) for gain in gains[method]),
            str(len(results.by_method[method])),
        ]
        for method in methods
    ]
    others = [m for m in methods if m != "evaps"]
    notes = [*_on(results, methods), *sentences(results, "evaps", others)]
    dots = {names[m]: [_dot(results, m, GOAL, k) for k in TOP] for m in methods}
    panels = [Panel(TITLES[GOAL], SHARE, dots)]
    if base:
        said = f"Gains are over {names[base]}, in points, over the seeds that both have, with 95 % intervals."
        notes.insert(1, said)
        gained = {names[m]: [None if gain is None else gain.dot for gain in gains[m]] for m in methods}
        panels.append(Panel(f"gain over {name_of(base)}", "points, 95 % interval", gained))
    title = "What the parts of EVAPS add; the paper's in brackets"
    return Table(title, head, rows, notes, number=2, picture=DotPlot(panels, SERIES))


def _on(results: Results, methods: Sequence[str]) -> list[str]:
    """Of what scale the methods are, and what Naive's row may be meant as, if there is one."""
    return [scale_note(results.of_methods(methods)), *([NAIVE] if "naive" in methods else [])]


def _cell(results: Results, method: str, metric: str, k: int) -> str:
    """Mean and deviation over seeds, with the paper's in brackets."""
    published = _published(metric, method, k)
    paper = "" if published is None else f" ({published:.1f})"
    return mean_and_deviation(results.top(method, metric, k)) + paper


def _dot(results: Results, method: str, metric: str, k: int) -> Dot | None:
    """The same as a dot; none if there are not so many candidates."""
    shares = results.top(method, metric, k)
    if np.isnan(shares).any():
        return None
    mean, deviation = float(shares.mean()), float(shares.std(ddof=1)) if len(shares) > 1 else 0.0
    return Dot(mean, mean - deviation, mean + deviation, _published(metric, method, k))


@dataclass(frozen=True)
class Gain:
    """How many points a method is ahead of another one.

    Attributes:
        ours: with its interval.
        paper: the same in the paper, if it says.
    """

    ours: Interval
    paper: float | None

    def __str__(self) -> str:
        return f"{self.ours}" if self.paper is None else f"{self.ours} ({self.paper:+.1f})"

    @property
    def dot(self) -> Dot:
        """What is drawn of it."""
        return Dot(self.ours.mean, self.ours.low, self.ours.high, self.paper)


def _gain(results: Results, method: str, base: str | None, k: int) -> Gain | None:
    """None if it cannot be said."""
    if base is None or method == base:
        return None
    try:
        found = results.difference(method, base, GOAL, k)
    except ValueError:  # not judged on the same tasks
        return None
    both = [_published(GOAL, m, k) for m in (method, base)]
    paper = None if both[0] is None or both[1] is None else both[0] - both[1]
    return Gain(found, paper)


def _published(metric: str, method: str, k: int) -> float | None:
    found = PUBLISHED[metric].get(method)
    return None if found is None else found[TOP.index(k)]
