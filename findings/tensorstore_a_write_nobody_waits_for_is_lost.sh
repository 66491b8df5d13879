#!/bin/sh
# tensorstore 0.1.86 (PyPI): a row whose write nobody waits for is never written.
#
# Guess before running: write() starts a write in the background. The data are in the file some seconds later, or at
# the latest when the program ends, even if the program does not keep the return value of write().
# Outcome: wrong. Without a reference to the returned futures the write is dropped, although write() has copied the
# data. After two seconds no row was on the disk, and the program that wrote them reads zeros as well. Nothing is
# raised or logged. A recorder that must not wait for the disk has to keep the futures until they are done. An
# assignment, drive[number] = row, waits for the disk and writes the row.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --no-compile --disable-pip-version-check tensorstore==0.1.86 numpy==2.4.6
cd "$folder"
"$folder/env/bin/python" - <<'PY'
import time

import numpy as np
import tensorstore

ROWS, WIDTH = 8, 4
SPEC = {"driver": "zarr", "kvstore": {"driver": "file", "path": "drive"}}


def on_disk() -> list[int]:
    """Read the first column with a context of its own, thus without any cache of the writer."""
    return tensorstore.open(SPEC, context=tensorstore.Context()).result().read().result()[:, 0].tolist()


drive = tensorstore.open(SPEC, create=True, dtype=tensorstore.uint8, shape=[ROWS, WIDTH]).result()
rows = [np.full(WIDTH, number + 1, np.uint8) for number in range(ROWS)]
for number, row in enumerate(rows):
    drive[number].write(row)
time.sleep(2)
dropped, here = on_disk(), drive.read().result()[:, 0].tolist()
kept = [drive[number].write(row) for number, row in enumerate(rows)]
time.sleep(2)
written = on_disk()
for number, row in enumerate(rows):
    drive[number] = row + 10
assigned = on_disk()
print(f"futures dropped: on the disk {dropped}, in the writer {here}; kept: {written}; assigned: {assigned}")
assert dropped.count(0) > ROWS // 2 and here == dropped
assert all(future.done() for future in kept)
assert written == [number + 1 for number in range(ROWS)]
assert assigned == [number + 11 for number in range(ROWS)]
PY
