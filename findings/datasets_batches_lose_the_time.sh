#!/bin/sh
# datasets 5.2.0 (PyPI, Hugging Face): in a batch of NumPy arrays, pictures of the same minute have the same time.
#
# Guess before running: with_format("numpy") returns a column of float64, such as the seconds since 1970 of each
# picture, as float64, both for one row and for a batch.
# Outcome: wrong. A single row is returned as float64, but a batch as float32, in which neighbouring values of today's
# time are 128 s apart. Pictures at 10 Hz therefore all have the same time, and map(batched=True) computes intervals
# of 0 from it and stores them. In the same way, integers become float32 as soon as one is missing, and uint8 pictures
# in lists become int64. The formats "arrow" and "pandas" return float64, and so does with_format("numpy",
# dtype=numpy.float64).
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check datasets==5.2.0 numpy==2.4.6
HF_HOME="$folder" HF_HUB_OFFLINE=1 "$folder/env/bin/python" -W ignore - <<'PY'
import datasets
import numpy as np

datasets.disable_progress_bars()
times = [1700000000 + number / 10 for number in range(5)]
pictures = [np.full((2, 3), number, np.uint8) for number in range(5)]
drive = datasets.Dataset.from_dict({"time": times, "lap": [1, 1, None, 2, 2], "picture": pictures})
assert drive.features["time"].dtype == "float64"
arrays = drive.with_format("numpy")
kinds = {name: (arrays[0][name].dtype.name, arrays[:][name].dtype.name) for name in drive.column_names}
print("type in a row and in a batch:", kinds)
intervals = arrays.map(lambda batch: {"interval": np.diff(batch["time"], prepend=batch["time"][0])}, batched=True)
stored = intervals.with_format(None)["interval"][:]
others = {
    "arrow": drive.with_format("arrow")[:]["time"].to_numpy(),
    "pandas": drive.with_format("pandas")[:]["time"].to_numpy(),
    "float64": drive.with_format("numpy", dtype=np.float64)[:]["time"],
}
print("stored intervals:", stored, {name: np.diff(column).round(3).tolist() for name, column in others.items()})
assert kinds == {"time": ("float64", "float32"), "lap": ("int64", "float32"), "picture": ("int64", "int64")}
assert stored == [0.0] * 5
assert all(column.tolist() == times for column in others.values())
PY
