#!/bin/sh
# rosbags-image 0.10.4 (rosbags 0.11.9, opencv-python-headless 5.0.0.93): a picture whose rows end with padding bytes
# becomes slanted.
#
# Guess before running: message_to_cvimage() reads the rows of a sensor_msgs/Image by its `step`, the length of a row
# in bytes, or refuses a row that is longer than its pixels.
# Outcome: wrong. It reads the bytes one after the other, as if no row had padding. Many camera drivers pad rows to a
# multiple of 4 or more bytes. A row of 210 pixels in rgb8 has 630 bytes, and thus two bytes of padding. Each row is
# therefore shifted by two bytes more than the row above it, colours are swapped, and the last rows are missing. No
# error is raised, size and type are right, and widths such as 640, which need no padding, are read correctly.
#
# Our reader of bags uses `step`.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check \
    rosbags==0.11.9 rosbags-image==0.10.4 opencv-python-headless==5.0.0.93 numpy==2.4.6
"$folder/env/bin/python" - <<'PY'
import numpy as np
from rosbags.image import message_to_cvimage
from rosbags.typesys import Stores, get_typestore

HEIGHT, FILL_TO = 150, 4
types = get_typestore(Stores.ROS2_HUMBLE).types


def through(width: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a picture, red on the left and blue on the right, and what is read of its message."""
    picture = np.zeros((HEIGHT, width, 3), np.uint8)
    picture[:, : width // 2, 0] = picture[:, width // 2 :, 2] = 255
    filling = -3 * width % FILL_TO
    rows = np.pad(picture.reshape(HEIGHT, 3 * width), ((0, 0), (0, filling)))
    stamp = types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    message = types["sensor_msgs/msg/Image"](
        header=types["std_msgs/msg/Header"](stamp=stamp, frame_id=""),
        height=HEIGHT,
        width=width,
        encoding="rgb8",
        is_bigendian=0,
        step=rows.shape[1],
        data=rows.ravel(),
    )
    return picture, message_to_cvimage(message, "rgb8")


for width in (640, 210):
    picture, found = through(width)
    same = (found == picture).all(axis=(1, 2))
    print(f"{width} pixels wide: {same.sum()} of {HEIGHT} rows are right; the last begins with {found[-1, 0].tolist()}")
    assert found.shape == picture.shape and found.dtype == picture.dtype
    assert same.all() if width == 640 else same.sum() == 1
PY
