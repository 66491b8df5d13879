"""Draws the README's figure from docs/results/1-retraining.json: `make docs`."""

from __future__ import annotations

import json
import math
from html import escape
from pathlib import Path

ROOT = Path(__file__).parents[2]
FIGURE = ROOT / "docs/images/retraining.svg"
_DATA = ROOT / "docs/results/1-retraining.json"
_ROWS = {
    "trial 1, box": "box, two moves",
    "trial 2, office": "office, two moves",
    "trial 3, office, RIGHT as well": "office, three moves",
}
_DOTS = {"published-32": "#8a8f98", "default-32": "#1769d2", "the teacher himself": "#e08a00"}
_NAMES = {
    "published-32": "the paper's learner",
    "default-32": "ours",
    "the teacher himself": "the teacher himself, a minute later",
}
_LEFT, _RIGHT, _TOP, _PITCH = 170, 620, 74, 46
_LEAST, _MOST = 0.01, 10.0


def _x(value: float) -> float:
    share = math.log(value / _LEAST) / math.log(_MOST / _LEAST)
    return round(_LEFT + share * (_RIGHT - _LEFT), 1)


def _text(x: float, y: float, text: str, anchor: str = "middle", extra: str = "") -> str:
    return f'<text x="{x}" y="{y}" text-anchor="{anchor}" fill="#222"{extra}>{escape(text)}</text>'


def render() -> str:
    """Return the figure as SVG: the robots' distances from their teachers, on a logarithmic
    scale."""
    data = json.loads(_DATA.read_text("utf-8"))
    bottom = _TOP + _PITCH * len(_ROWS) - 14
    title = "How far from their teacher robots drive after retraining (SSD, median of ten)"
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 660 {bottom + 52}" width="660" '
        f'font-family="sans-serif" font-size="13" role="img" aria-label="{escape(title)}">',
        f"<title>{escape(title)}</title>",
        f'<rect width="660" height="{bottom + 52}" rx="10" fill="#fff"/>',
        _text(330, 24, title, extra=' font-weight="bold"'),
    ]
    for (column, colour), x in zip(_DOTS.items(), (_LEFT, 325, 390), strict=True):
        lines.append(f'<circle cx="{x}" cy="46" r="6" fill="{colour}"/>')
        lines.append(_text(x + 11, 50, _NAMES[column], "start"))
    for value in (0.01, 0.1, 1.0, 10.0):
        x = _x(value)
        lines.append(f'<path d="M{x} {_TOP - 12}V{bottom}" stroke="#ddd"/>')
        lines.append(_text(x, bottom + 18, f"{value:g}"))
    lines.append(_text(_LEFT, bottom + 38, "nearer", "start"))
    lines.append(_text(_RIGHT, bottom + 38, "farther", "end"))
    measured = {row["what"]: row["measured"] for row in data["rows"]}
    for i, (what, name) in enumerate(_ROWS.items()):
        y = _TOP + 12 + i * _PITCH
        lines.append(_text(_LEFT - 14, y + 5, name, "end"))
        lines.append(f'<path d="M{_LEFT} {y}H{_RIGHT}" stroke="#eee"/>')
        for column, colour in _DOTS.items():
            cell = measured[what][data["columns"].index(column)].partition(" ")[0]
            x = _x(float(cell))
            lines.append(f'<circle cx="{x}" cy="{y}" r="6" fill="{colour}"/>')
            below = 20 if column == "the teacher himself" else -10  # two dots may lie together
            lines.append(_text(x, y + below, cell, extra=' font-size="11"'))
    return "\n".join([*lines, "</svg>"]) + "\n"
