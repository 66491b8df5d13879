"""Plots as SVG text, by matplotlib (the extra `experiments`)."""

from __future__ import annotations

import io
from typing import Any

from robot.errors import need
from robot.lab.experiment import Plot


def draw_svg(plot: Plot) -> str:
    """Return one plot as an SVG element; lines over numbers, points over names.

    Raises:
        MissingExtraError: If matplotlib is not installed.
    """
    matplotlib = need("matplotlib", "plots", "experiments")
    matplotlib.use("Agg")
    matplotlib.rcParams["svg.hashsalt"] = "drivelesson"  # the same plot, the same bytes
    from matplotlib.figure import Figure

    figure: Any = Figure(figsize=(6.4, 3.2), layout="constrained")
    axes = figure.add_subplot()
    for name, xs, ys in plot.series:
        is_named = any(isinstance(x, str) for x in xs)
        axes.plot(xs, ys, "o" if is_named else "o-", label=name, markersize=5)
    axes.set(title=plot.title, xlabel=plot.x_label, ylabel=plot.y_label)
    if plot.log_y and all(y > 0 for _, _, ys in plot.series for y in ys):
        axes.set_yscale("log")
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small")
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    svg = text.getvalue()
    return svg[svg.index("<svg") :]
