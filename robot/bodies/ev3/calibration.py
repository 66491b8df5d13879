"""Wheel diameter and track from measured distances and angles. Pure."""

from __future__ import annotations

import math
from dataclasses import replace

from robot.bodies.ev3.chassis import ChassisOptions
from robot.errors import ConfigurationError

LARGEST_CORRECTION = 3.0
"""A measurement that is so many times off is a slip of the pen, or a motor at the wrong port."""


def rolled_m(wheel_deg: float, options: ChassisOptions) -> float:
    """How far a wheel rolls when it turns so far, by the measures so far."""
    return wheel_deg / 360 * math.pi * options.wheel_diameter_m


def turned_deg(left_deg: float, right_deg: float, options: ChassisOptions) -> float:
    """How far the robot turns when its wheels turn so far; counter-clockwise is positive."""
    across_m = rolled_m(right_deg, options) - rolled_m(left_deg, options)
    return math.degrees(across_m / options.track_m)


def fit_wheels(options: ChassisOptions, wheel_deg: float, measured_m: float) -> ChassisOptions:
    """Return the options whose wheel diameter makes `wheel_deg` roll `measured_m`.

    Raises:
        ConfigurationError: If the wheels' counts or the measurement are impossible.
    """
    factor = _factor(measured_m, rolled_m(wheel_deg, options), "distance", "m")
    return replace(options, wheel_diameter_m=round(options.wheel_diameter_m * factor, 5))


def fit_track(
    options: ChassisOptions, left_deg: float, right_deg: float, measured_deg: float
) -> ChassisOptions:
    """Return the options whose track makes the wheels' turns turn the robot `measured_deg`."""
    expected_deg = turned_deg(left_deg, right_deg, options)
    factor = _factor(measured_deg, expected_deg, "angle", "degrees")
    return replace(options, track_m=round(options.track_m / factor, 5))


def _factor(measured: float, expected: float, what: str, unit: str) -> float:
    if expected <= 0:
        raise ConfigurationError(
            f"the wheels turned for a {what} of {expected:.3g} {unit}: check --left-port, "
            "--right-port and --reversed-motors"
        )
    factor = measured / expected
    if not 1 / LARGEST_CORRECTION < factor < LARGEST_CORRECTION:
        raise ConfigurationError(
            f"a {what} of {measured:.3g} {unit} does not go with the wheels, which make it "
            f"{expected:.3g}; measure again"
        )
    return factor
