"""A picture of a table: a line for each of its rows, dots for our figures, and diamonds for the paper's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from evaps.report.drawing import drawn

COLORS = ("tab:blue", "tab:orange", "tab:green")
PAPERS = "the paper's"


@dataclass(frozen=True)
class Dot:
    """A figure, and how far it may be off.

    Attributes:
        value: what was measured.
        low: the lower end of what is drawn around it.
        high: the upper end.
        paper: what the paper has, if it says.
    """

    value: float
    low: float
    high: float
    paper: float | None = None


@dataclass(frozen=True)
class Panel:
    """Figures of one kind.

    Attributes:
        title: what is shown.
        unit: of it, and what is drawn around it.
        dots: by the name of a row its dots: one for each of the plot's series, or None where there is none.
    """

    title: str
    unit: str
    dots: Mapping[str, Sequence[Dot | None]]


@dataclass(frozen=True)
class DotPlot:
    """Panels side by side with the same rows.

    Attributes:
        panels: from left to right.
        series: what the dots of a row are, in order.
    """

    panels: Sequence[Panel]
    series: Sequence[str]

    def records(self) -> list[list[str]]:
        """Head and rows of all dots, one in a row, as a program would read them."""
        return [
            ["shown", "row", "of", "value", "low", "high", "paper"],
            *(
                [panel.title, row, name, *(_number(x) for x in (dot.value, dot.low, dot.high, dot.paper))]
                for panel in self.panels
                for row, dots in panel.dots.items()
                for name, dot in zip(self.series, dots, strict=True)
                if dot is not None
            ),
        ]

    def draw(self) -> dict[str, bytes]:
        """The picture as ``"png"`` and as ``"svg"``.

        Raises:
            UserError: there is no matplotlib.
        """
        rows = list(dict.fromkeys(row for panel in self.panels for row in panel.dots))
        size = 1.6 + 3.2 * len(self.panels), 1.3 + 0.36 * len(rows)
        return drawn(*size, lambda canvas: self._on(canvas, rows))

    def _on(self, canvas: Any, rows: Sequence[str]) -> None:
        from matplotlib.lines import Line2D

        axes = canvas.subplots(1, len(self.panels), sharey=True, squeeze=False)[0]
        for ax, panel in zip(axes, self.panels, strict=True):
            for place, row in enumerate(rows):
                _draw_row(ax, place, panel.dots.get(row, ()))
            ax.set(title=panel.title, xlabel=panel.unit)
            ax.grid(alpha=0.3)
        axes[0].set_yticks(range(len(rows)), rows)
        axes[0].invert_yaxis()
        keys = [Line2D([], [], marker="o", color=color) for color in COLORS]
        keys.append(Line2D([], [], marker="D", linestyle="", color="gray", fillstyle="none"))
        canvas.legend(keys, [*self.series, PAPERS], loc="outside lower center", ncols=4, frameon=False)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def _draw_row(ax: Any, place: int, dots: Sequence[Dot | None]) -> None:
    for i, dot in enumerate(dots):
        if dot is not None:
            color, y = COLORS[i], place + 0.2 * (i - (len(dots) - 1) / 2)
            ax.plot([dot.low, dot.high], [y, y], color=color, linewidth=1.2)
            ax.plot(dot.value, y, marker="o", markersize=4, color=color)
            if dot.paper is not None:
                ax.plot(dot.paper, y, marker="D", markersize=4, color=color, fillstyle="none")
