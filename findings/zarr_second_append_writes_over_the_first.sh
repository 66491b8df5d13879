#!/bin/sh
# zarr 3.1.6: once metadata have been consolidated, the second append() overwrites the first.
#
# Guess before running: when a group is opened for writing, its arrays have their current length. If two more drives
# are appended to a recording, each by another run of a program, they follow each other.
# Outcome: wrong. open_group() uses the consolidated metadata if there are any, even with mode="a", and append() and
# resize() do not update them. The next run starts from the old length again: the third drive overwrites the second,
# the fourth would overwrite the third, and readers see only the first. Setting an attribute through this group also
# writes the old length into the array's own metadata. No error is raised, and no warning mentions a length. With
# use_consolidated=False, each time, everything is right.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check zarr==3.1.6 numpy==2.4.6
cd "$folder"
"$folder/env/bin/python" - <<'PY'
import warnings

import zarr


def record(zarr_format: int, **how) -> dict[str, list[int]]:
    store = f"drives{zarr_format}{len(how)}.zarr"
    first = zarr.create_group(store, zarr_format=zarr_format).create_array("drive", shape=(2,), chunks=(2,), dtype="i4")
    first[:] = 1
    zarr.consolidate_metadata(store, zarr_format=zarr_format)
    for number in (2, 3):
        zarr.open_group(store, mode="a", **how)["drive"].append([number] * 2)
    seen = {
        "reader": zarr.open_group(store, mode="r", **how)["drive"][:].tolist(),
        "array itself": zarr.open_array(f"{store}/drive", mode="r")[:].tolist(),
    }
    zarr.open_group(store, mode="a", **how)["drive"].attrs["robot"] = "rover"
    return seen | {"after an attribute": zarr.open_array(f"{store}/drive", mode="r")[:].tolist()}


with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always")
    found = [record(number) for number in (2, 3)]
    right = record(3, use_consolidated=False)
print(found, right, sep="\n")
assert found == [{"reader": [1, 1], "array itself": [1, 1, 3, 3], "after an attribute": [1, 1]}] * 2
assert set(map(tuple, right.values())) == {(1, 1, 2, 2, 3, 3)}
assert all("not part in the Zarr format 3" in str(one.message) for one in said)
PY
