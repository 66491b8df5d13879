#!/bin/sh
# moteus 1.1.1 (PyPI): a speed that does not fit into the chosen resolution is sent as another speed, without an error.
#
# Guess before running: if a program sends speeds as INT16 to save bytes on the bus, make_position raises an error for a
# speed that 16 bits cannot hold.
# Outcome: wrong. A speed above 8.19 revolutions per second is sent as 8.19, in INT8 above 12.7 as 12.7; so the coarser
# of the two reaches the higher speed. In INT8 a slow speed of 0.04 is sent as 0. The command itself gives no sign.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --no-compile --disable-pip-version-check moteus==1.1.1
"$folder/env/bin/python" - <<'PY'
import math

import moteus

SPEEDS = 0.04, 5.0, 20.0


def sent(resolution: int, speed: float) -> float:
    """Return the speed in the bytes of the command, in revolutions per second."""
    wanted = moteus.PositionResolution()
    wanted.position, wanted.velocity = moteus.IGNORE, resolution
    command = moteus.Controller(id=1, position_resolution=wanted).make_position(velocity=speed, query=False)
    bytes_of, unit = {moteus.INT8: (1, 0.1), moteus.INT16: (2, 0.00025)}[resolution]
    return int.from_bytes(command.data[-bytes_of:], "little", signed=True) * unit


for name, resolution in (("INT8", moteus.INT8), ("INT16", moteus.INT16)):
    print(name, {speed: round(sent(resolution, speed), 3) for speed in SPEEDS})
assert [round(sent(moteus.INT8, speed), 3) for speed in SPEEDS] == [0.0, 5.0, 12.7]
assert math.isclose(sent(moteus.INT16, 5.0), 5.0) and math.isclose(sent(moteus.INT16, 20.0), 8.19175)
PY
