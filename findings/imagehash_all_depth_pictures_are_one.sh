#!/bin/sh
# ImageHash 4.3.2 (pillow 13.0.0): all depth pictures have the same hash.
#
# Guess before running: pictures of 16 bits, such as a depth camera's millimetres, are hashed by their content, as
# average_hash, phash, dhash and whash are made of ratios and signs only; or they are refused.
# Outcome: wrong. The picture is first converted to 8 bits, where pillow clips: all beyond 255 mm becomes 255, and one
# white picture is left. So a wall, a corner and their mirror images are "duplicates" with a distance of 0, and a
# program that drops repeated pictures from a recording keeps one. Pictures of floats from 0 to 1 become black, with
# the same effect. The same depths in centimetres and in 8 bits differ.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check ImageHash==4.3.2 pillow==13.0.0 numpy==2.4.6 \
  scipy==1.17.1 PyWavelets==1.9.0
"$folder/env/bin/python" - <<'PY'
import imagehash
import numpy as np
from PIL import Image

y, x = np.mgrid[0:48, 0:64]
wall = 1000 + 20 * x
corner = 600 + 60 * np.abs(x - 20) + 5 * y
scenes = [wall, corner, wall[:, ::-1], corner[:, ::-1]]
kinds = {"uint16 mm": ("u2", 1), "float 0 to 1": ("f4", 5000), "uint8 cm": ("u1", 20)}
found = {}
for kind, (dtype, by) in kinds.items():
    pictures = [Image.fromarray((scene / by).astype(dtype)) for scene in scenes]
    for name in ("average_hash", "phash", "dhash", "whash"):
        found[kind, name] = len({str(getattr(imagehash, name)(picture)) for picture in pictures})
for key, number in found.items():
    print(*key, "different hashes of four pictures:", number)
assert all(number == (4 if kind == "uint8 cm" else 1) for (kind, _), number in found.items())
PY
