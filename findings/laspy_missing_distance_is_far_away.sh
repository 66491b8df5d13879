#!/bin/sh
# laspy 2.7.0: points are rounded to a grid of one centimetre, and a missing distance becomes a point 21,000 km away.
#
# Guess before running: las.x = distances keeps float64 numbers to a millimetre, at least until the file is written.
# NaN, with which depth cameras mark pixels that they could not measure, is refused.
# Outcome: wrong in both cases. Each coordinate becomes a 32-bit integer as soon as it is assigned, and the default
# scale of a header is 0.01: 4 mm become 0, and 1.2345 m become 1.23 m. NaN becomes the smallest integer, -21474836.48
# m, with only NumPy's RuntimeWarning ("invalid value encountered in cast"), which names neither laspy nor the point.
# The file is written with a bounding box of that size in its header, so a mean or a map's extent is useless. With
# header.scales = 0.001, set before the points, 1.2345 m become 1.234 m, and NaN becomes -2147483.648 m.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --no-compile --disable-pip-version-check laspy==2.7.0 numpy==2.4.6
cd "$folder"
"$folder/env/bin/python" - <<'PY'
import warnings

import laspy
import numpy as np

DISTANCES_M = np.array([1.2345, 0.004, np.nan])
found = {}
for scale in (None, 0.001):
    las = laspy.create()
    if scale is not None:
        las.header.scales = [scale] * 3
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        las.x = DISTANCES_M
    at_once = np.array(las.x).tolist()
    las.write("room.las")
    read = laspy.read("room.las")
    assert np.array(read.x).tolist() == at_once and read.header.mins[0] == min(at_once)
    found[scale] = at_once
    print(f"scale {scale}: {at_once}, warnings: {[str(one.message) for one in told]}")
    assert [one.category for one in told] == [RuntimeWarning]
assert np.allclose(found[None], [1.23, 0.0, -21474836.48])
assert np.allclose(found[0.001], [1.234, 0.004, -2147483.648])
PY
