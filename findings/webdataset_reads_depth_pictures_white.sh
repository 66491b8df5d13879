#!/bin/sh
# webdataset 1.0.2 (pillow 13.0.0): the depth pictures that it writes are white when it reads them.
#
# Guess before running: TarWriter writes a uint16 array as a PNG of 16 bits, or refuses it, and decode() returns what
# was written, at least with "pil", which requests pillow's own picture.
# Outcome: half wrong. The PNG in the tar is right: 16 bits, in millimetres. But each of the decoders for pictures
# first converts it to 8 bits, and pillow clips everything beyond 255 mm. Every picture of a room is therefore 255, or
# 1.0 with decoders of floats, without a warning. With the suffix .npy the array is read back unchanged.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check webdataset==1.0.2 pillow==13.0.0 numpy==2.4.6
cd "$folder"
"$folder/env/bin/python" -W error::UserWarning - <<'PY'
import io
import tarfile

import numpy as np
import webdataset
from PIL import Image

depth = (600 + 60 * np.arange(48).reshape(6, 8)).astype(np.uint16)
with webdataset.TarWriter("room.tar") as writer:
    writer.write({"__key__": "0001", "png": depth, "npy": depth})
with tarfile.open("room.tar") as tar:
    written = np.asarray(Image.open(io.BytesIO(tar.extractfile("0001.png").read())))
print("in the tar:", written.dtype, written.min(), written.max())
assert np.array_equal(written, depth)
found = {}
for how in ("pil", "pill", "rgb8", "l8", "rgb", "l"):
    (sample,) = webdataset.WebDataset("room.tar", shardshuffle=False).decode(how)
    found[how] = sorted(set(np.asarray(sample["png"]).ravel().tolist()))
    assert np.array_equal(sample["npy"], depth)
print("values read:", found)
assert found == {"pil": [255], "pill": [255], "rgb8": [255], "l8": [255], "rgb": [1.0], "l": [1.0]}
PY
