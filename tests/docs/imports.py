"""Writes docs/reference/imports.md from the table of formats: `make docs`."""

from __future__ import annotations

from pathlib import Path

from robot.exchange.columns import NAMES
from robot.exchange.forms import FORMS, UNUSABLE
from robot.exchange.steering import FULL_MPS, FULL_TURN_DEG_S

PAGE = Path(__file__).parents[2] / "docs/reference/imports.md"
_HEAD = """# Formats that can be imported

`make docs` writes this page from the program; do not edit it by hand.

`drivelesson episodes import PATH` ([how to use it](../howto/episodes.md#import)) imports a file, an
archive, or a folder with its subfolders. The command tries the formats below in this order, and
uses the first that fits. On this page, steering and throttle are numbers from -1 to 1; positive
values mean right and ahead. The command imports steering beyond `--threshold` as a turn. Pictures
on which the car stands still or drives backward do not become examples. Data with velocities, or
with the speeds of two wheels, may also contain turns on the spot.
"""


def render() -> str:
    """Return the whole page docs/reference/imports.md."""
    parts = [_HEAD, "## The formats\n"]
    for form in FORMS:
        parts.append(f"### {form.name[0].upper()}{form.name[1:]}\n")
        parts.append(f"| | |\n|---|---|\n| files | {form.there} |\n| label | {form.label} |")
        parts.append(f"| time | {form.time} |\n")
    parts.append("## Names of columns\n\n| meaning (`--columns`) | names |\n|---|---|")
    parts += [f"| {role} | {', '.join(f'`{n}`' for n in names)} |" for role, names in NAMES.items()]
    parts.append(
        "\nCapitals and spaces do not matter; `linear.x` is the same as `linear_x`. The name of "
        "a time or velocity may end in a unit in brackets (`angular.z [deg/s]`). "
        f"A velocity of {FULL_MPS:g} m/s or more counts as full throttle, and "
        f"{FULL_TURN_DEG_S:g} degrees a second or more counts as full lock.\n\n"
        "## What is recognised and refused\n\n"
        "| files | why |\n|---|---|"
    )
    parts += [f"| {', '.join(f'`{e}`' for e in ends)} | {why} |" for ends, why in UNUSABLE.items()]
    return "\n".join(parts) + "\n"
