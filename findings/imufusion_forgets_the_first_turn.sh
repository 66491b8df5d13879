#!/bin/sh
# imufusion 1.3.3 (PyPI): a turn in the first three seconds does not change the heading.
#
# Guess before running: a robot that lies level and turns by 90 degrees in the two seconds after the start has turned by
# 90 degrees, as the gyroscope says.
# Outcome: wrong. Without a magnetometer the heading is held at 0 for the first three seconds, and the turn is lost for
# good: the robot then stands at 0 degrees. After skip_startup() the same turn counts.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --no-compile --disable-pip-version-check imufusion==1.3.3 numpy==2.4.6
"$folder/env/bin/python" - <<'PY'
import imufusion
import numpy as np

LEVEL = np.array([0.0, 0.0, 1.0])  # acceleration in g


def heading_after(turned_s: tuple[float, float], *, skips: bool) -> float:
    """Return the heading after five seconds, if the robot turned at 45 degrees a second in between."""
    ahrs = imufusion.Ahrs()
    ahrs.set_sample_period(0.01)
    if skips:
        ahrs.skip_startup()
    for step in range(500):
        rate = 45.0 if turned_s[0] <= step * 0.01 < turned_s[1] else 0.0
        ahrs.update_no_magnetometer(np.array([0.0, 0.0, rate]), LEVEL)
    return float(imufusion.quaternion_to_euler(ahrs.get_quaternion())[2])


early, late = heading_after((0.0, 2.0), skips=False), heading_after((3.0, 5.0), skips=False)
skipped = heading_after((0.0, 2.0), skips=True)
print(f"turned from 0 to 2 s: {early:.1f} degrees; from 3 to 5 s: {late:.1f}")
print(f"from 0 to 2 s after skip_startup: {skipped:.1f}")
assert abs(early) < 0.1 and abs(late - 90) < 1.5 and abs(skipped - 90) < 1.5
PY
