#!/bin/sh
# opencv-python-headless 5.0.0.93, av 18.1.0: OpenCV reports the right time of each picture of a film with irregular
# times, but seeking to that time leads to another picture.
#
# Guess before running: set(CAP_PROP_POS_MSEC, t) with the time that get() reported for a picture leads to this
# picture.
# Outcome: wrong. The time is multiplied by the average rate and used as the number of a picture. In a film with
# pictures at 0, 10, 20, 30, 1000, 1040, 1500 and 1540 ms, the time of the fifth picture leads to the last one, and
# later times lead beyond the end, where nothing is read. set(CAP_PROP_POS_FRAMES, n) leads to picture n.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check opencv-python-headless==5.0.0.93 av==18.1.0 numpy==2.4.6
cd "$folder"
"$folder/env/bin/python" - <<'EOF'
from fractions import Fraction

import av
import cv2
import numpy as np

TIMES_MS = [0, 10, 20, 30, 1000, 1040, 1500, 1540]
with av.open("film.mp4", "w") as container:
    stream = container.add_stream("libx264", rate=30)
    stream.width, stream.height, stream.pix_fmt = 160, 120, "yuv420p"
    stream.codec_context.time_base = Fraction(1, 1000)
    for number, time_ms in enumerate(TIMES_MS):
        picture = av.VideoFrame.from_ndarray(np.full((120, 160, 3), 20 + 25 * number, np.uint8), format="rgb24")
        picture.pts, picture.time_base = time_ms, Fraction(1, 1000)
        container.mux(stream.encode(picture))
    container.mux(stream.encode())
film = cv2.VideoCapture("film.mp4")


def read() -> int | None:
    is_read, picture = film.read()
    return round((float(picture.mean()) - 20) / 25) if is_read else None


told = {}
while (number := read()) is not None:
    told[number] = round(film.get(cv2.CAP_PROP_POS_MSEC))
by_time, by_number = [], []
for number, time_ms in told.items():
    film.set(cv2.CAP_PROP_POS_MSEC, time_ms)
    by_time.append(read())
    film.set(cv2.CAP_PROP_POS_FRAMES, number)
    by_number.append(read())
print("told:", told, "by time:", by_time, "by number:", by_number)
assert list(told.values()) == TIMES_MS and by_number == list(range(8))
assert by_time == [0, 0, 0, 0, 7, None, None, None]
EOF
