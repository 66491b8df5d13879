#!/bin/sh
# av 18.1.0 (FFmpeg 8.1.2, libx264): the length of an MP4 film with irregular times ends before its last pictures.
#
# Guess before running: the stream's duration is the time of the last picture, plus one picture.
# Outcome: wrong if x264 may reorder pictures, which is its default. Pictures at 0, 10, 20, 30 and 1000 ms give a film
# of 0.07 s, although its last picture is decoded with the right time. The duration is the sum of decoding times,
# which run ahead because of the reordering. Without B-frames (bf=0) the film is 1.03 s long. At a constant rate both
# durations are right.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet av==18.1.0 numpy==2.4.6
"$folder/env/bin/python" - <<'EOF'
import io
from fractions import Fraction

import av
import numpy as np


def film(times_ms: list[int], options: dict[str, str]) -> bytes:
    out = io.BytesIO()
    with av.open(out, "w", format="mp4") as container:
        stream = container.add_stream("libx264", rate=30, options=options)
        stream.width, stream.height, stream.pix_fmt = 160, 120, "yuv420p"
        stream.codec_context.time_base = Fraction(1, 1000)
        for count, time_ms in enumerate(times_ms):
            pixels = np.full((120, 160, 3), 5 * count, np.uint8)
            picture = av.VideoFrame.from_ndarray(pixels, format="rgb24")
            picture.pts, picture.time_base = time_ms, Fraction(1, 1000)
            container.mux(stream.encode(picture))
        container.mux(stream.encode())
    return out.getvalue()


def length_and_last_s(data: bytes) -> tuple[float, float]:
    with av.open(io.BytesIO(data)) as container:
        stream = container.streams.video[0]
        length_s = float(stream.duration * stream.time_base)
        return round(length_s, 2), [round(picture.time, 2) for picture in container.decode(stream)][-1]


paused, steady = [0, 10, 20, 30, 1000], [0, 100, 200, 300, 400]
found = {name: length_and_last_s(film(times, options)) for name, times, options in (
    ("paused", paused, {}), ("paused, bf=0", paused, {"bf": "0"}), ("steady", steady, {}))}
print(found)
assert found == {"paused": (0.07, 1.0), "paused, bf=0": (1.03, 1.0), "steady": (0.43, 0.4)}
EOF
