#!/bin/sh
# AHRS 0.4.0: the complementary filter confuses south with north.
#
# Guess before running: Complementary averages headings as angles. The heading of a robot that turns past 180 degrees,
# or that stands still and faces south, then agrees with Madgwick's heading within a few degrees.
# Outcome: wrong. The filter averages the plain numbers. The compass jumps from 180 to -180, and the mean of the two
# is 0, which is north. For a robot that turns evenly, the heading is up to 172 degrees off each time it passes south.
# For a robot that stands still and faces south, with a compass that varies by one degree, the mean error is 146
# degrees. Madgwick is right in both cases. Tests that begin at north and turn by less than half a turn pass.
#
# Our robots do not fuse sensors.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check ahrs==0.4.0 numpy==2.4.6
"$folder/env/bin/python" - <<'PY'
import numpy as np
from ahrs.filters import Complementary, Madgwick

RATE_HZ, SAMPLES = 100.0, 1500


def off(filter_class: type, heading_rad: np.ndarray, compass_rad: np.ndarray) -> np.ndarray:
    """Return the error of the heading in each sample, in degrees."""
    turning = np.gradient(heading_rad) * RATE_HZ
    zeros = np.zeros(SAMPLES)
    found = filter_class(
        gyr=np.stack([zeros, zeros, turning], axis=1),
        acc=np.tile([0.0, 0.0, 9.81], (SAMPLES, 1)),
        mag=np.stack([20.0 * np.cos(compass_rad), -20.0 * np.sin(compass_rad), np.full(SAMPLES, -40.0)], axis=1),
        frequency=RATE_HZ,
    ).Q
    heading = 2.0 * np.arctan2(found[:, 3], found[:, 0])
    return np.abs((np.rad2deg(heading - heading_rad) + 180.0) % 360.0 - 180.0)


turn = np.deg2rad(30.0) * np.arange(SAMPLES) / RATE_HZ
south = np.full(SAMPLES, np.pi)
trembling = south + np.deg2rad(np.random.default_rng(0).normal(0.0, 1.0, SAMPLES))
for name, heading, compass in (("turning", turn, turn), ("looking south", south, trembling)):
    complementary = off(Complementary, heading, compass)
    madgwick = off(Madgwick, heading, compass)
    most, mean = complementary.max(), complementary.mean()
    print(f"{name}: Complementary up to {most:.0f} degrees off, {mean:.0f} in the mean; Madgwick {madgwick.max():.1f}")
    assert most > 160.0 and madgwick.max() < 1.0
    assert name == "turning" or mean > 100.0
PY
