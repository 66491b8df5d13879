"""Runs in donkeycar's environment: uses an exported tub as donkeycar's users do."""

from __future__ import annotations

import shutil
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
from donkeycar.parts.tub_v2 import Tub

export, out = map(Path, sys.argv[1:])
print("VERSION", version("donkeycar"))
copy = out / "tub"
shutil.copytree(export, copy)


def opened() -> Tub:
    first = Tub(str(copy), read_only=True)
    inputs, types = first.manifest.inputs, first.manifest.types
    first.close()
    return Tub(str(copy), inputs=inputs, types=types)


print("TRY reads every record and picture")
tub = opened()
records = list(tub)
assert len(records) == tub.manifest.current_index > 0
assert all((copy / "images" / record["cam/image_array"]).is_file() for record in records)
assert {"user/angle", "user/throttle", "user/mode"} <= set(records[0])
print("PASSED", f": {len(records)} of {tub.manifest.current_index}")

print("TRY deletes")
tub.delete_records([0, 1, 2])
tub.close()
tub = opened()
assert len(list(tub)) == len(records) - 3
print("PASSED")

print("TRY appends")
columns = dict(zip(tub.manifest.inputs, tub.manifest.types, strict=True))
blank = {
    "float": 0.0,
    "str": "",
    "int": 1,
    "boolean": False,
    "image_array": np.zeros((9, 9, 3), "u1"),
}
record = {name: blank[kind] for name, kind in columns.items()}
tub.write_record(record | {"user/mode": "user", "drivelesson/label": "left"})
tub.close()
tub = opened()
assert len(list(tub)) == len(records) - 2
tub.close()
print("PASSED")
