#!/bin/sh
# pyvips 3.2.0 (libvips 8.18.7): a depth array is saved as a white PNG of 8 bits, and its thumbnail is white.
#
# Guess before running: new_from_array() of a uint16 array gives a picture of 16 bits, which pngsave() writes with
# 16 bits, as tiffsave() does, and which thumbnail_image() shrinks to the mean depths.
# Outcome: wrong. The picture holds 16 bits, but is marked "b-w", as which 255 is white. PNG writes 8 bits for that and
# clips, so 600 mm and 5 m are both 255, and so does the thumbnail. Nothing is raised. TIFF is right. With
# interpretation="grey16" PNG is right, but the thumbnail is then of 8 bits, divided by 256: its steps are 256 mm.
# shrink() keeps millimetres.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check pyvips==3.2.0 pyvips-binary==8.18.7 numpy==2.4.6
"$folder/env/bin/python" - <<'PY'
import numpy as np
import pyvips

y, x = np.mgrid[0:120, 0:160]
depth = (600 + 20 * x + 10 * y).astype(np.uint16)
means = depth.reshape(30, 4, 40, 4).mean((1, 3))
found = {}
for mark in (None, "grey16"):
    picture = pyvips.Image.new_from_array(depth, interpretation=mark)
    for name in ("png", "tiff"):
        seen = pyvips.Image.new_from_buffer(getattr(picture, f"{name}save_buffer")(), "").numpy()
        found[mark, name] = (seen.dtype.name, int(seen.min()), int(seen.max()))
    small = picture.thumbnail_image(40).numpy()
    found[mark, "thumbnail"] = (small.dtype.name, int(small.min()), int(small.max()))
    assert np.abs(picture.shrink(4, 4).numpy() - means).max() <= 1
for key, value in found.items():
    print(*key, *value)
kept = ("uint16", int(depth.min()), int(depth.max()))
assert found[None, "png"] == found[None, "thumbnail"] == ("uint8", 255, 255)
assert found[None, "tiff"] == found["grey16", "tiff"] == found["grey16", "png"] == kept
assert found["grey16", "thumbnail"] == ("uint8", 3, 19)
PY
