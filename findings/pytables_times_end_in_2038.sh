#!/bin/sh
# tables 3.11.1 (PyTables): a column of 64-bit times ends in the year 2038, and a missing time becomes 1970.
#
# Guess before running: Time64Col, "64-bit time", stores a float64 number of seconds, precise to at least a
# microsecond. It also stores NaN for a missing time, and numbers such as milliseconds since 1970, or it refuses what
# it cannot store.
# Outcome: wrong. A time is stored as 32 bits of seconds and 32 bits of microseconds, as formerly in C. The second
# after 03:14:07 on 19 January 2038 is read back as the year 1901, milliseconds since 1970 become another time, and
# NaN becomes 0, which is 1970. There is no error or warning. h5py cannot read the type (TypeError). Float64Col stores
# all these times.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --no-compile --disable-pip-version-check tables==3.11.1 numpy==2.4.6
cd "$folder"
"$folder/env/bin/python" -W error - <<'PY'
import numpy as np
import tables

LAST_S = 2**31 - 1
TIMES = np.array([1_700_000_000.125, LAST_S + 0.5, LAST_S + 1.5, 1_700_000_000_125.0, np.nan])
with tables.open_file("drive.h5", "w") as file:
    rows = file.create_table("/", "rows", {"time": tables.Time64Col(), "number": tables.Float64Col()})
    rows.append(list(zip(TIMES, TIMES, strict=True)))
with tables.open_file("drive.h5") as file:
    times, numbers = file.root.rows.col("time"), file.root.rows.col("number")
    recent = len(file.root.rows.read_where("time > 1e9")), len(file.root.rows.read_where("number > 1e9"))
for written, read in zip(TIMES, times, strict=True):
    print(f"{written:18.3f} is read back as {read:18.3f}")
print("rows after 2001: by the time", recent[0], "by the number", recent[1])
assert times[:2].tolist() == TIMES[:2].tolist()
assert times[2] == 0.5 - 2**31
assert abs(times[3]) < 2**31 and times[4] == 0.0
assert np.array_equal(numbers, TIMES, equal_nan=True)
assert recent == (2, 4)
PY
