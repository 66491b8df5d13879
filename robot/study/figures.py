"""The figures of a study's report as SVG text, without a library: equal on every machine."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from html import escape

_WIDTH, _HEIGHT = 480, 280
_LEFT, _RIGHT, _TOP, _BOTTOM = 64, 16, 36, 40
_STYLE = "font-family='system-ui, sans-serif' font-size='12' fill='#1d2327'"
_PILOT, _ROBOT = "#b87900", "#006ba8"
_LEAST = 1e-300  # a tenth of a smaller number underflows


def strips(title: str, columns: Mapping[str, Mapping[str, float]], *, joined: bool) -> str:
    """Draw one measure: a column per condition, a dot per participant, a bar at the mean.

    Args:
        title: The measure.
        columns: By condition, the values by participant.
        joined: True if a line joins the dots of one participant.
    """
    every = [value for values in columns.values() for value in values.values()]
    low, high, ticks = _axis(min(every, default=0.0), max(every, default=1.0))

    def y(value: float) -> float:
        return _TOP + (high - value) / (high - low) * (_HEIGHT - _TOP - _BOTTOM)

    names = list(columns)
    room = (_WIDTH - _LEFT - _RIGHT) / max(1, len(names))
    x = {name: _LEFT + room * (i + 0.5) for i, name in enumerate(names)}
    parts = list(_grid(ticks, y))
    for name in names:
        parts.append(_text(x[name], _HEIGHT - 14, name, "middle"))
    if joined:
        for one, other in itertools.pairwise(names):
            for code in sorted(columns[one].keys() & columns[other].keys()):
                ends = (x[one], y(columns[one][code]), x[other], y(columns[other][code]))
                parts.append(_line(ends, "#a0adb6", 1))
    for name, values in columns.items():
        for code in sorted(values):
            parts.append(
                f"<circle cx='{_n(x[name])}' cy='{_n(y(values[code]))}' r='4' fill='{_ROBOT}' "
                f"fill-opacity='0.6'><title>{escape(code)}: {values[code]:g}</title></circle>"
            )
        if values:
            mean = y(math.fsum(values.values()) / len(values))
            parts.append(_line((x[name] - 24, mean, x[name] + 24, mean), "#1d2327", 2.5))
    return _svg(title, parts)


def curves(title: str, pilot: Sequence[float], robot: Sequence[float], step_m: float) -> str:
    """Draw two Behavior Profiles of one move, up to 2 m: the pilots' and the robots' mean."""
    n = round(2.0 / step_m) + 1

    def x(i: int) -> float:
        return _LEFT + i / (n - 1) * (_WIDTH - _LEFT - _RIGHT)

    def y(share: float) -> float:
        return _TOP + (1.0 - share) * (_HEIGHT - _TOP - _BOTTOM)

    parts = list(_grid([0.0, 0.25, 0.5, 0.75, 1.0], y))
    for metres in (0.0, 0.5, 1.0, 1.5, 2.0):
        parts.append(_text(x(round(metres / step_m)), _HEIGHT - 14, f"{metres:g} m", "middle"))
    for shares, colour, dash in ((pilot, _PILOT, ""), (robot, _ROBOT, "6 4")):
        points = " ".join(f"{_n(x(i))},{_n(y(p))}" for i, p in enumerate(shares[:n]))
        parts.append(
            f"<polyline points='{points}' fill='none' stroke='{colour}' stroke-width='2.5' "
            f"stroke-dasharray='{dash}'/>"
        )
    parts.append(_text(_WIDTH - _RIGHT, _TOP - 6, "amber: pilots, blue, dashed: robots", "end"))
    return _svg(title, parts)


def _axis(least: float, most: float) -> tuple[float, float, list[float]]:
    """Return the ends of an axis, and round numbers on it."""
    span = (most - least) or abs(most)
    span = span if span > _LEAST else 1.0
    step = 10.0 ** math.floor(math.log10(span / 3))
    for factor in (5, 2):
        if span / (step * factor) >= 3:
            step *= factor
            break
    first, last = math.floor(least / step), math.ceil(most / step)
    last = last if last > first else first + 1
    return first * step, last * step, [i * step for i in range(first, last + 1)]


def _grid(ticks: Sequence[float], y: Callable[[float], float]) -> Iterator[str]:
    for tick in ticks:
        yield _line((_LEFT, y(tick), _WIDTH - _RIGHT, y(tick)), "#d5dade", 1)
        yield _text(_LEFT - 8, y(tick) + 4, f"{tick:g}", "end")


def _line(ends: tuple[float, float, float, float], colour: str, width: float) -> str:
    x1, y1, x2, y2 = map(_n, ends)
    return (
        f"<line x1='{x1}' y1='{y1}' x2='{x2}' y2='{y2}' stroke='{colour}' stroke-width='{width}'/>"
    )


def _text(x: float, y: float, text: str, anchor: str) -> str:
    return f"<text x='{_n(x)}' y='{_n(y)}' text-anchor='{anchor}'>{escape(text)}</text>"


def _n(value: float) -> str:
    return f"{value:.2f}"


def _svg(title: str, parts: Sequence[str]) -> str:
    size = f"viewBox='0 0 {_WIDTH} {_HEIGHT}' width='{_WIDTH}' height='{_HEIGHT}'"
    head = _text(_LEFT, 16, title, "start").replace("<text", "<text font-weight='bold'")
    return (
        f"<svg xmlns='http://www.w3.org/2000/svg' {size} role='img' {_STYLE}>"
        f"<title>{escape(title)}</title><rect width='100%' height='100%' fill='#fff'/>"
        f"{head}{''.join(parts)}</svg>\n"
    )
