"""A figure: lines over one axis, with bands, in one or several panels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from evaps.report.drawing import drawn
from evaps.report.names import PLACES
from evaps.report.table import Table

COLUMNS = 8  # of a figure as a table


@dataclass(frozen=True)
class Line:
    """Points, and how far they may be off.

    Attributes:
        x: where.
        y: the values.
        low: the lower end of each value's interval; none if empty.
        high: the upper end.
        of: lines of one thing have one colour; by default each is of its own.
        dashes: of four kinds, to tell lines of one colour apart.
    """

    x: Sequence[float]
    y: Sequence[float]
    low: Sequence[float] = ()
    high: Sequence[float] = ()
    of: str = ""
    dashes: int = 0

    def points(self) -> Iterator[tuple[float, ...]]:
        """Where, the value, and the ends of its interval if there is one."""
        columns = (self.x, self.y, self.low, self.high) if len(self.low) else (self.x, self.y)
        return zip(*columns, strict=True)

    def at(self, x: float) -> str:
        """The value there, with its interval; nothing if there is no point."""
        if x not in self.x:
            return ""
        i = list(self.x).index(x)
        return f"{self.y[i]:.3g}" + (f" [{self.low[i]:.1f}, {self.high[i]:.1f}]" if len(self.low) else "")


@dataclass(frozen=True)
class Figure:
    """Panels side by side, with the same kind of thing along their first axis.

    Attributes:
        panels: for each panel its title and its lines by their names.
        x: what the first axis shows, with its unit.
        y: what the second axis shows, with its unit.
        log: whether the first axis is logarithmic.
        alike: whether all panels show the same, on the same axes.
        notes: sentences for those who read it as a table: scale, and what the paper has.
    """

    panels: Mapping[str, Mapping[str, Line]]
    x: str
    y: str
    log: bool = False
    alike: bool = True
    notes: Sequence[str] = ()

    def styles(self) -> dict[str, dict[str, Any]]:
        """Colour and dashes of each line, by its name: a method has its colour in all panels and figures."""
        named = {name: line for lines in self.panels.values() for name, line in lines.items()}
        others = {line.of or name: None for name, line in named.items() if (line.of or name) not in PLACES}
        places = PLACES | {group: len(PLACES) + i for i, group in enumerate(others)}
        return {name: _style(places[line.of or name], line.dashes) for name, line in named.items()}

    def tables(self) -> list[Table]:
        """A table for each panel: some of its points, the first and the last among them."""
        shown = {title: lines for title, lines in self.panels.items() if lines}
        tables = []
        for title, lines in shown.items():
            every = sorted({x for line in lines.values() for x in line.x})
            at = [every[i] for i in np.unique(np.linspace(0, len(every) - 1, COLUMNS).round().astype(int))]
            rows = [[name, *(line.at(x) for x in at)] for name, line in lines.items()]
            last = title == list(shown)[-1]
            head = [self.x, *(f"{x:,.0f}" if x >= 1_000 else f"{x:.4g}" for x in at)]
            tables.append(Table(f"{self.y}, {title}", head, rows, self.notes if last else ()))
        return tables

    def csv(self) -> str:
        """All points, one in a row."""
        rows = [
            [title, name, *(f"{value:.6g}" for value in point)]
            for title, lines in self.panels.items()
            for name, line in lines.items()
            for point in line.points()
        ]
        return Table("", ["panel", "line", self.x, self.y, "low", "high"], rows).csv()

    def draw(self) -> dict[str, bytes]:
        """The picture as ``"png"`` and as ``"svg"``.

        Raises:
            UserError: there is no matplotlib.
        """
        columns = 2 if len(self.panels) == 4 else min(3, len(self.panels))
        rows = -(-len(self.panels) // columns)
        names = len({name for lines in self.panels.values() for name in lines})
        beside = min(columns + 1, names)
        return drawn(
            max(6.4, 1.5 + 3.4 * columns),
            0.4 + 2.6 * rows + 0.2 * -(-names // beside),  # with the legend's lines
            lambda canvas: self._on(canvas, rows, columns, beside),
        )

    def _on(self, canvas: Any, rows: int, columns: int, beside: int) -> None:
        from matplotlib.lines import Line2D

        styles = self.styles()
        axes = canvas.subplots(
            rows, columns, sharex=self.alike, sharey="row" if self.alike else False, squeeze=False
        ).ravel()
        for ax, (title, lines) in zip(axes, self.panels.items(), strict=False):
            self._panel(ax, title, lines, styles)
        for ax in axes[len(self.panels) :]:
            ax.set_visible(False)
        keys = [Line2D([], [], marker=".", **style) for style in styles.values()]  # bands have none
        canvas.legend(keys, list(styles), loc="outside lower center", ncols=beside, frameon=False)

    def _panel(
        self, ax: Any, title: str, lines: Mapping[str, Line], styles: Mapping[str, dict[str, Any]]
    ) -> None:
        for name, line in lines.items():
            style = styles[name]
            ax.plot(line.x, line.y, marker=".", linewidth=1.2, markersize=4, **style)
            if len(line.low):
                ax.fill_between(line.x, line.low, line.high, color=style["color"], alpha=0.15, linewidth=0)
        ax.set(title=title, xlabel=self.x, ylabel=self.y)
        ax.tick_params(labelbottom=True)  # a panel may have none below it
        if self.alike and not ax.get_subplotspec().is_first_col():
            ax.set_ylabel("")
        ax.grid(alpha=0.3)
        if self.log:
            ax.set_xscale("log")
            _tick_few(ax, lines)
        else:
            ax.xaxis.get_major_locator().set_params(integer=True)  # candidates, rounds, batches


def _tick_few(ax: Any, lines: Mapping[str, Line]) -> None:
    """Where there are few points on a logarithmic axis, these are its ticks."""
    every = sorted({x for line in lines.values() for x in line.x})
    if 0 < len(every) <= COLUMNS:
        ax.set_xticks(every, [f"{x:,.0f}" for x in every])
        ax.set_xticks([], minor=True)


def _style(place: int, dashes: int) -> dict[str, Any]:
    """There are twenty colours, ten of them lighter, and of each colour four kinds of dashes."""
    import matplotlib

    color = matplotlib.colormaps["tab20"](2 * place % 20 + place // 10 % 2)
    return {"color": color, "linestyle": ("-", "--", ":", "-.")[dashes % 4]}
