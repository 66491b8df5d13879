"""Options of `drivelesson serve` for the corrections."""

from __future__ import annotations

import argparse
from dataclasses import dataclass

from robot.adjustments.corrections import MOST_TRIM, REVERSED
from robot.devices.options import Options, option, options_of
from server.cli.parser import declare


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrectionOptions(Options):
    """Corrections of a robot that is built differently; each is saved until it is changed."""

    reverse: str = option("none", "the motors whose direction is reversed", choices=REVERSED)
    swap_sides: bool = option(False, "exchange the left and the right motor")
    trim: float = option(
        0.0,
        "correction of the steering while the robot should drive straight, as a share of full "
        "lock; positive values steer right: use them if the robot pulls to the left",
        range=(-MOST_TRIM, MOST_TRIM),
    )
    turn_picture: int = option(
        0, "turn the camera's pictures clockwise by 0, 90, 180 or 270 degrees"
    )
    mirror_picture: bool = option(False, "exchange left and right in the camera's pictures")


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare an option for each correction."""
    group = parser.add_argument_group("corrections", str(CorrectionOptions.__doc__))
    for one in options_of(CorrectionOptions):
        declare(group, one)
