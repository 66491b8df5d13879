#!/bin/sh
# h5py 3.16.0 (HDF5 2.0.0): a live reader (SWMR) sees the numbers of a recording, but no JPEG picture or label.
#
# Guess before running: in a file that one program writes and another reads (single writer, multiple readers),
# refresh() shows all flushed rows of any type. Or a type that does not work in this mode is refused when the dataset
# is created, when the mode is switched on, or when a row is written.
# Outcome: wrong. Values of variable length, such as JPEG pictures and strings, are accepted without an error. The
# reader sees the new length, but reading any row raises OSError ("address of object past end of allocation"), even
# after the reader has opened the file again. Once the writer has closed its file, all rows can be read. Pictures in
# rows of a fixed length work.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --no-compile --disable-pip-version-check h5py==3.16.0 numpy==2.4.6
cd "$folder"
cat > read.py <<'PY'
import h5py
import json
import sys


def read(file: h5py.File) -> dict[str, object]:
    found = {}
    for name in ("time", "fixed", "picture", "label"):
        file[name].refresh()
        try:
            found[name] = [len(file[name]), len(file[name][:])]
        except OSError as error:
            found[name] = [len(file[name]), str(error)]
    return found


file = h5py.File("drive.h5", "r", swmr=True)
print("ready", flush=True)
sys.stdin.readline()
print(json.dumps(read(file)), flush=True)
file.close()
with h5py.File("drive.h5", "r", swmr=True) as file:
    print(json.dumps(read(file)), flush=True)
PY
"$folder/env/bin/python" - <<'PY'
import json
import subprocess
import sys

import h5py
import numpy as np

ROWS = 5
kinds = {
    "time": ((), np.float64),
    "fixed": ((64,), np.uint8),
    "picture": ((), h5py.vlen_dtype(np.uint8)),
    "label": ((), h5py.string_dtype()),
}
with h5py.File("drive.h5", "w", libver="latest") as file:
    for name, (shape, kind) in kinds.items():
        file.create_dataset(name, (0, *shape), kind, maxshape=(None, *shape), chunks=(16, *shape))
    file.swmr_mode = True
    reader = subprocess.Popen([sys.executable, "read.py"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert reader.stdout.readline() == "ready\n"
    for number in range(ROWS):
        jpeg = np.full(64, number, np.uint8)
        for name, value in {"time": number / 10, "fixed": jpeg, "picture": jpeg[: 40 + number], "label": "l"}.items():
            file[name].resize(number + 1, axis=0)
            file[name][number] = value
            file[name].flush()
    reader.stdin.write("read\n")
    reader.stdin.flush()
    live, opened = (json.loads(reader.stdout.readline()) for _ in range(2))
    assert reader.wait() == 0
with h5py.File("drive.h5") as file:
    closed = {name: [len(file[name]), len(file[name][:])] for name in kinds}
print("length and rows read: while it is written", live, "opened again", opened, "closed", closed, sep="\n")
for found in (live, opened):
    assert found["time"] == found["fixed"] == [ROWS, ROWS]
    for name in ("picture", "label"):
        assert found[name][0] == ROWS and "past end of allocation" in found[name][1]
assert set(map(tuple, closed.values())) == {(ROWS, ROWS)}
PY
