"""Pictures as PNG and as SVG; matplotlib, which draws them, is optional."""

from __future__ import annotations

import io
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

from evaps.dsl import UserError


def can_draw() -> bool:
    """Whether there is matplotlib."""
    return find_spec("matplotlib") is not None


def drawn(width: float, height: float, paint: Callable[[Any], None]) -> dict[str, bytes]:
    """A picture as ``"png"`` and as ``"svg"``; the same picture is the same bytes.

    Args:
        width: in inches.
        height: in inches.
        paint: is given matplotlib's figure.

    Raises:
        UserError: there is no matplotlib.
    """
    if not can_draw():
        raise UserError("figures need matplotlib; try: pip install 'evaps[report]'")
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context({"svg.hashsalt": "evaps", "font.size": 9}):
        canvas = Figure(figsize=(width, height), layout="constrained")
        paint(canvas)
        png, svg = io.BytesIO(), io.BytesIO()
        canvas.savefig(png, format="png", dpi=160)
        canvas.set_layout_engine("none")  # what was laid out stays where it is
        canvas.savefig(svg, format="svg", metadata={"Date": None})
    return {"png": png.getvalue(), "svg": svg.getvalue()}
