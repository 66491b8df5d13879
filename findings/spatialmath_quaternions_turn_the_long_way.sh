#!/bin/sh
# spatialmath-python 1.1.18 (PyPI): between the same two headings, poses turn the short way and quaternions the long way.
#
# Guess before running: half way between the headings 170 and -170 degrees, which are 20 degrees apart, is 180 degrees,
# whichever class describes the heading.
# Outcome: wrong for quaternions. SO2, SE2 and SE3 turn by 20 degrees. UnitQuaternion.interp turns by 340 degrees, and
# passes through 0, where the robot looks backward. The option shortest=True makes it turn the short way.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --no-compile --disable-pip-version-check spatialmath-python==1.1.18 numpy==2.4.6
"$folder/env/bin/python" - <<'PY'
from spatialmath import SE2, SE3, SO2, UnitQuaternion

FIRST, LAST = 170, -170


def yaw(pose: object) -> float:
    return float(abs(pose.rpy(unit="deg")[2]))


found = {
    "SO2": abs(float(SO2(FIRST, unit="deg").interp(SO2(LAST, unit="deg"), 0.5).theta(unit="deg"))),
    "SE2": abs(float(SE2(0, 0, FIRST, unit="deg").interp(SE2(1, 0, LAST, unit="deg"), 0.5).theta(unit="deg"))),
    "SE3": yaw(SE3.Rz(FIRST, unit="deg").interp(SE3.Rz(LAST, unit="deg"), 0.5)),
}
one, two = (UnitQuaternion.Rz(heading, unit="deg") for heading in (FIRST, LAST))
found["UnitQuaternion"] = yaw(one.interp(two, 0.5))
found["UnitQuaternion, shortest=True"] = yaw(one.interp(two, 0.5, shortest=True))
for name, heading in found.items():
    print(f"{name}: half way at {heading:.1f} degrees")
long_way = found.pop("UnitQuaternion")
assert long_way < 1e-6
assert all(abs(heading - 180) < 1e-6 for heading in found.values())
PY
