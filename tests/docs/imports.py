"""Writes docs/reference/imports.md from the table of formats: `make docs`."""

from __future__ import annotations

from pathlib import Path

from robot.exchange.columns import NAMES
from robot.exchange.forms import FORMS, UNUSABLE
from robot.exchange.steering import FULL_MPS, FULL_TURN_DEG_S

PAGE = Path(__file__).parents[2] / "docs/reference/imports.md"
_HEAD = """# Forms that can be imported

Made from the program by `make docs`; do not edit by hand.

`drivelesson episodes import PATH` recognises these forms, in this order, in a file, a folder,
folders within it, or an archive ([how to use it](../howto/episodes.md#import)). Steering and
throttle here go from -1 to 1; right and ahead are positive. Steering beyond `--threshold` turns.
A car that stands or drives backward gives no example. A robot with two wheels, or one that is
driven by velocities, may also spin.
"""


def render() -> str:
    """Return the whole page."""
    parts = [_HEAD, "## The forms\n"]
    for form in FORMS:
        parts.append(f"### {form.name[0].upper()}{form.name[1:]}\n")
        parts.append(f"| | |\n|---|---|\n| there | {form.there} |\n| label | {form.label} |")
        parts.append(f"| time | {form.time} |\n")
    parts.append("## Names of columns\n\n| meaning (`--columns`) | names |\n|---|---|")
    parts += [f"| {role} | {', '.join(f'`{n}`' for n in names)} |" for role, names in NAMES.items()]
    parts.append(
        "\nCapitals, spaces and units in brackets do not matter; `linear.x` is `linear_x`. "
        f"Full throttle of velocities is {FULL_MPS:g} m/s, full lock {FULL_TURN_DEG_S:g} degrees a "
        "second; beyond counts as full.\n\n## What is recognised and refused\n\n"
        "| files | why |\n|---|---|"
    )
    parts += [f"| {', '.join(f'`{e}`' for e in ends)} | {why} |" for ends, why in UNUSABLE.items()]
    return "\n".join(parts) + "\n"
