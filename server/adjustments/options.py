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

    reverse: str = option("none", "the motors that turn the other way", choices=REVERSED)
    swap_sides: bool = option(False, "the left motor and the right motor are exchanged")
    trim: float = option(
        0.0,
        "steering to the right (negative: left) that is added where the robot should drive "
        "straight, as a share of full lock: a robot that pulls to the left needs a positive trim",
        range=(-MOST_TRIM, MOST_TRIM),
    )
    turn_picture: int = option(
        0, "turns the camera's pictures clockwise, until they are upright: 0, 90, 180 or 270"
    )
    mirror_picture: bool = option(False, "exchanges left and right of the camera's pictures")


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare an option for each correction."""
    group = parser.add_argument_group("corrections", str(CorrectionOptions.__doc__))
    for one in options_of(CorrectionOptions):
        declare(group, one)
