#!/bin/sh
# zarr 3.1.6: rows that were cut off an array come back when the array grows again.
#
# Guess before running: resize() to fewer rows, and then to more, gives new rows with the fill value, as in HDF5.
# Outcome: wrong. Only whole chunks are deleted. Rows that share a chunk with the last remaining row stay in it, and
# reappear. If the last rows of a recording are deleted, and its arrays are then enlarged for new rows, the deleted
# rows look as if they had been recorded: a label of -1, for "not taught", is the old label again. The number of rows
# that come back depends on the chunks: of 10 rows in chunks of 4, cut to 5, three come back. append() overwrites
# them.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check zarr==3.1.6 h5py==3.16.0 numpy==2.4.6
cd "$folder"
"$folder/env/bin/python" - <<'PY'
import h5py
import numpy as np
import zarr

how = {"shape": (10,), "chunks": (4,), "dtype": "i4"}
file = h5py.File("labels.h5", "w")
arrays = {
    "Zarr 2": zarr.create_array("two.zarr", fill_value=-1, zarr_format=2, **how),
    "Zarr 3": zarr.create_array("three.zarr", fill_value=-1, zarr_format=3, **how),
    "HDF5": file.create_dataset("labels", maxshape=(None,), fillvalue=-1, **how),
}
found = {}
for name, array in arrays.items():
    array[:] = np.arange(10)
    array.resize((5,))
    assert array.shape == (5,)
    array.resize((10,))
    found[name] = array[:].tolist()
print(found)
assert found["HDF5"] == [0, 1, 2, 3, 4, -1, -1, -1, -1, -1]
assert found["Zarr 2"] == found["Zarr 3"] == [0, 1, 2, 3, 4, 5, 6, 7, -1, -1]
PY
