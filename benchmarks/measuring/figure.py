"""A figure of one chart, as SVG; the same content gives the same bytes."""

import io
from collections.abc import Callable
from typing import Any

from arena.extras import needs


def draw_figure(name: str, x: str, y: str, fill: Callable[[Any], None]) -> bytes:
    """Return a chart with a logarithmic x-axis.

    Parameters
    ----------
    name
        Of the figure.
    x, y
        What the axes say.
    fill
        Draws into matplotlib's axes.
    """
    with needs("train", "this figure"):
        from matplotlib import rc_context, style
        from matplotlib.figure import Figure

    chart = io.BytesIO()
    with style.context("tableau-colorblind10"), rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        figure = Figure(figsize=(7.2, 4), layout="constrained")
        fill(figure.add_subplot(xlabel=x, ylabel=y, xscale="log"))
        figure.savefig(chart, format="svg", metadata={"Date": None})
    return chart.getvalue()
