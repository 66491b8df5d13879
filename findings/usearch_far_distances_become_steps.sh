#!/bin/sh
# usearch 2.26.6 (PyPI): an index of float32 vectors stores eight bits of each number, so the nearest scan is another one.
#
# Guess before running: an index made with only `ndim` and `metric` stores the float32 vectors that it is given, so an
# exact search among 24 lidar scans finds each scan itself, at the distance 0.
# Outcome: wrong. The default type is BF16 whatever the type of the vectors. Distances of about 5 m in millimetres
# become multiples of 32 mm, `get` returns the rounded numbers, and without a warning most searches find another
# place. With dtype="f32" each search finds its own scan. Bytes from 0 to 255 are not affected.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --no-compile --disable-pip-version-check usearch==2.26.6 numpy==2.4.6
"$folder/env/bin/python" - <<'PY'
import numpy as np
from usearch.index import Index

PLACES, BEAMS = 24, 36
steps_mm = np.arange(PLACES, dtype=np.float32)[:, None]
scans_mm = np.full((PLACES, BEAMS), 5000, np.float32) + steps_mm  # a robot that moves 1 mm from place to place


def found(**options: str) -> tuple[list[int], float]:
    """Return the nearest place of each scan, and the largest error of a stored distance."""
    index = Index(ndim=BEAMS, metric="l2sq", **options)
    index.add(np.arange(PLACES), scans_mm)
    nearest = [int(index.search(scan, 1, exact=True).keys[0]) for scan in scans_mm]
    stored = np.array([index.get(place) for place in range(PLACES)], np.float32)
    return nearest, float(np.abs(stored - scans_mm).max())


rounded, error_mm = found()
exact, none_mm = found(dtype="f32")
print(f"default: nearest {rounded}, stored with an error of up to {error_mm:g} mm")
print(f'dtype="f32": nearest {exact}, stored with an error of up to {none_mm:g} mm')
right = sum(place == number for number, place in enumerate(rounded))
assert right <= 2 and error_mm >= 8
assert exact == list(range(PLACES)) and none_mm == 0
PY
