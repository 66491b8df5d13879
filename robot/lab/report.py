"""Writes all results to one HTML file: tables, plots, and the command that made them."""

from __future__ import annotations

import contextlib
import io
import platform
from collections.abc import Iterable, Iterator, Sequence
from html import escape
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from robot.errors import need
from robot.lab.experiment import Experiment, Plot, Runs
from robot.study.table import Table, format_cell

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 75rem; margin: 2rem auto; padding: 0 1rem;
       color: #1d2327; background: #fff }
table { border-collapse: collapse; font-size: .85rem; margin: 1rem 0; display: block;
        overflow-x: auto }
th, td { padding: .25rem .6rem; border-bottom: 1px solid #d5dade; text-align: right }
th { text-align: right; font-weight: 600; vertical-align: bottom }
td:first-child, th:first-child { text-align: left }
tr.paper { color: #5b6770; font-style: italic }
figure { margin: 1rem 0 } figure svg { max-width: 100%; height: auto }
pre { background: #f2f4f5; padding: .8rem; overflow-x: auto }
"""


def write_html(made: Iterable[tuple[Experiment, Runs]], command: str) -> str:
    """Return the report on some experiments as HTML, with the command line that ran them."""
    parts = [
        "<!doctype html><html lang=en><meta charset=utf-8>",
        "<meta name=viewport content='width=device-width, initial-scale=1'>",
        f"<title>Drivelesson: experiments</title><style>{_STYLE}</style>",
        "<h1>The paper's experiments, repeated in simulation</h1>",
        f"<h2>How it was made</h2><pre>{escape(command)}</pre>",
        f"<p>{escape('; '.join(machine()))}</p>",
        *(html for experiment, runs in made for html in _section(experiment, runs)),
    ]
    return "\n".join(parts) + "\n"


def machine() -> list[str]:
    """Describe this machine: its processor, Python, and the relevant libraries."""
    names = ("drivelesson", "numpy", "panda3d", "scikit-learn", "joblib")
    return [
        f"{platform.system()} {platform.machine()}, {processor()}",
        f"Python {platform.python_version()}",
        *(f"{name} {_version(name)}" for name in names),
    ]


def processor() -> str:
    """Return the processor's name, from Linux or else from Python."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text("utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or "unknown processor"


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "missing"


def _section(experiment: Experiment, runs: Runs) -> Iterator[str]:
    tables = experiment.tables(runs)
    plots = [_of_columns(table, experiment.drawn) for table in tables if experiment.drawn]
    yield f"<h2>{escape(experiment.title)}</h2><p>{escape(experiment.text)}</p>"
    for plot in (*plots, *experiment.plots(runs)):
        yield f"<figure>{draw_svg(plot)}</figure>"
    for table in tables:
        yield f"<h3>{escape(table.title)}</h3><table><thead><tr>"
        yield "".join(f"<th>{escape(column)}" for column in table.columns) + "</thead><tbody>"
        for row in table.rows:
            kind = " class=paper" if str(row[0]).startswith("paper") else ""
            cells = "".join(f"<td>{escape(format_cell(cell))}" for cell in row)
            yield f"<tr{kind}>{cells}"
        yield "</tbody></table>"
        if table.note:
            yield f"<p>{escape(table.note)}</p>"


def _of_columns(table: Table, columns: Sequence[str]) -> Plot:
    names = [str(row[0]) for row in table.rows]
    places = [table.columns.index(column) for column in columns]
    series = [(table.columns[i], names, [row[i] for row in table.rows]) for i in places]
    return Plot(title=table.title, series=series)


def draw_svg(plot: Plot) -> str:
    """Return one plot as an SVG element: lines over numbers, or one point for each name. Raises
    MissingExtraError if matplotlib is not installed."""
    matplotlib = need("matplotlib", "plots", "experiments")
    matplotlib.use("Agg")
    # with a fixed salt, equal plots are saved as equal bytes
    matplotlib.rcParams["svg.hashsalt"] = "drivelesson"
    from matplotlib.figure import Figure

    has_names = isinstance(plot.series[0][1][0], str)
    height = 1.0 + 0.25 * len(plot.series[0][1]) if has_names else 3.2
    figure: Any = Figure(figsize=(6.4, height), layout="constrained")
    axes = figure.add_subplot()
    for name, xs, ys in plot.series:
        known = [(x, y) for x, y in zip(xs, ys, strict=True) if y is not None]
        if has_names:
            axes.plot([y for _, y in known], [x for x, _ in known], "o", label=name)
        else:
            axes.plot(*zip(*known, strict=True), "o-", label=name)
    values = [y for _, _, ys in plot.series for y in ys if y is not None]
    if has_names and 0.0 < 30.0 * min(values) < max(values):
        axes.set_xscale("log")
    axes.set(title=plot.title, xlabel=plot.x_label, ylabel=plot.y_label)
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small")
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    svg = text.getvalue()
    return svg[svg.index("<svg") :]
