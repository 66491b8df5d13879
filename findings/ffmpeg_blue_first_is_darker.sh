#!/bin/sh
# av 18.1.0 (FFmpeg 8.1.2, swscale): the same pixels become a darker and slightly green picture in YUV 4:2:0 if blue
# is their first byte.
#
# Guess before running: rgb24 and bgr24 with the same colours give the same yuv420p, because only the order of the
# bytes differs. A second guess, made before a picture of odd width was converted: there is no difference for odd
# widths, because a fast path needs pairs of pixels.
# Outcome: the first guess is wrong, the second one right. If the size does not change, bgr24 is converted by a
# function of its own, which rounds down, while the usual function rounds to the nearest value. Grey (128, 128, 128)
# becomes 125, 127, 127 instead of 126, 128, 128, so it is no longer grey, and white becomes 234 instead of 235. The
# usual function is used for a picture of odd width, for a picture that is also scaled, and for yuv422p.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet av==18.1.0 numpy==2.4.6
"$folder/env/bin/python" - <<'EOF'
import av
import numpy as np


def converted(grey: int, order: str, width: int = 16, to: str = "yuv420p", scale: int = 1) -> tuple[int, ...]:
    pixels = np.full((16, width, 3), grey, np.uint8)
    frame = av.VideoFrame.from_ndarray(pixels, format=order)
    planes = frame.reformat(width=width * scale, height=16 * scale, format=to).planes
    return tuple(bytes(plane)[0] for plane in planes)


found = {
    (order, name): converted(128, order, **options)
    for order in ("rgb24", "bgr24")
    for name, options in {
        "plain": {},
        "odd width": {"width": 17},
        "scaled": {"scale": 2},
        "yuv422p": {"to": "yuv422p"},
    }.items()
}
white = converted(255, "rgb24"), converted(255, "bgr24")
print(found, white)
assert found.pop(("bgr24", "plain")) == (125, 127, 127)
assert set(found.values()) == {(126, 128, 128)}
assert white == ((235, 128, 128), (234, 127, 127))
EOF
