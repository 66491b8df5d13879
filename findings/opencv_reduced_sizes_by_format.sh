#!/bin/sh
# opencv-python-headless 5.0.0.93: the size of a picture that is decoded at one eighth depends on its file format.
#
# Guess before running: IMREAD_REDUCED_GRAYSCALE_8 rounds the sides in the same way for every format.
# Outcome: wrong. A JPEG of 9x9 pixels becomes 2x2 (rounded up, as libjpeg scales). A PNG, BMP, WebP or TIFF of the
# same size becomes 1x1 (rounded down, resized after decoding). A JPEG of 7x7 pixels becomes 1x1, but a PNG of 7x7 is
# not decoded at all: imdecode raises an assertion error of resize.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet opencv-python-headless==5.0.0.93
"$folder/env/bin/python" - <<'EOF'
import cv2
import numpy as np


def reduced(ending: str, side: int) -> object:
    data = cv2.imencode(ending, np.zeros((side, side, 3), np.uint8))[1]
    try:
        return cv2.imdecode(data, cv2.IMREAD_REDUCED_GRAYSCALE_8).shape
    except cv2.error:
        return "error"


found = {ending: (reduced(ending, 9), reduced(ending, 7)) for ending in (".jpg", ".png", ".bmp", ".webp", ".tiff")}
print(found)
assert found.pop(".jpg") == ((2, 2), (1, 1))
assert set(found.values()) == {((1, 1), "error")}
EOF
