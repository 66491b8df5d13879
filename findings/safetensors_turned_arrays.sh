#!/bin/sh
# safetensors 0.8.0 (numpy 2.4.6): an array that is a view, such as a transposed picture, is read back with other
# values.
#
# Guess before running: save() of safetensors.numpy writes the values of the array, or refuses a view, as save() of
# safetensors.torch does ("non contiguous tensor").
# Outcome: wrong. It writes the memory in its own order, under the shape of the view, and raises no error. A picture
# whose channels were moved to the front is read back as stripes. Of an array of every second column, the first half
# of the columns is read back. Shape and type are right, and a transposed array keeps its mean and its extremes, so a
# short check finds no fault. numpy.ascontiguousarray before save() helps. Byte-swapped arrays are saved correctly.
#
# Our models are .npz files, which keep the order.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check safetensors==0.8.0 numpy==2.4.6
"$folder/env/bin/python" - <<'PY'
import numpy as np
from safetensors.numpy import load, save

picture = np.arange(4 * 6 * 3, dtype=np.float32).reshape(4, 6, 3)
arrays = {
    "as it is": picture,
    "swapped bytes": picture.astype(">f4"),
    "channels first": picture.transpose(2, 0, 1),
    "every second column": picture[:, ::2],
    "Fortran's order": np.asfortranarray(picture),
}
is_kept = {}
for name, array in arrays.items():
    back = load(save({"weights": array}))["weights"]
    assert back.shape == array.shape
    is_kept[name] = np.array_equal(back, array)
    mended = load(save({"weights": np.ascontiguousarray(array)}))["weights"]
    assert np.array_equal(mended, array)
print(is_kept)
assert [name for name, kept in is_kept.items() if kept] == ["as it is", "swapped bytes"]
PY
