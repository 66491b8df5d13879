#!/bin/sh
# numcodecs 0.16.6 (PyPI): a distance that does not fit into the chosen bytes is stored as a small one.
#
# Guess before running: FixedScaleOffset, with which arrays of sensor values are made small, limits a value that does
# not fit to the largest number, or raises an error.
# Outcome: wrong. Distances in metres, stored in steps of 0.1 m in one byte, begin again at zero: a wall at 25.6 m comes
# back as 0 m, one at 30 m as 4.4 m, and the -0.1 with which some sensors report an error as 25.5 m. All of this happens
# without an error or a warning. An infinite distance comes back as 0 m, with numpy's warning of an invalid value.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --no-compile --disable-pip-version-check numcodecs==0.16.6 numpy==2.4.6
"$folder/env/bin/python" - <<'PY'
import warnings

import numpy as np
from numcodecs import FixedScaleOffset

codec = FixedScaleOffset(offset=0, scale=10, dtype="f4", astype="u1")
measured_m = np.array([0.5, 25.5, 25.6, 30.0, -0.1], "f4")
with warnings.catch_warnings():
    warnings.simplefilter("error")
    stored_m = codec.decode(codec.encode(measured_m))
for before, after in zip(measured_m, stored_m, strict=True):
    print(f"measured {before:g} m, stored {after:g} m")
assert np.allclose(stored_m, [0.5, 25.5, 0.0, 4.4, 25.5])
PY
