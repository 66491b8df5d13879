#!/bin/sh
# imageio-ffmpeg 0.8.1, av 18.1.0: the pictures read from a film with irregular times are not the pictures of the
# film, even if their number is right.
#
# Guess before running: read_frames yields each picture of the film once.
# Outcome: wrong. ffmpeg repeats and drops pictures until they have a constant rate, which it takes from the file. The
# same eight pictures become 47 from a Matroska file. From an MP4 file eight are read, but the third is missing and
# the fourth occurs twice, so a comparison with count_frames_and_secs finds no fault. With output_params=["-fps_mode",
# "passthrough"] both files yield the eight pictures.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check imageio-ffmpeg==0.8.1 av==18.1.0 numpy==2.4.6
cd "$folder"
"$folder/env/bin/python" - <<'EOF'
from fractions import Fraction

import av
import imageio_ffmpeg
import numpy as np


def write(path: str) -> None:
    with av.open(path, "w") as container:
        stream = container.add_stream("libx264", rate=30, options={"bf": "0"})
        stream.width, stream.height, stream.pix_fmt = 160, 120, "yuv420p"
        stream.codec_context.time_base = Fraction(1, 1000)
        for number, time_ms in enumerate((0, 10, 20, 30, 1000, 1040, 1500, 1540)):
            picture = av.VideoFrame.from_ndarray(np.full((120, 160, 3), 20 + 25 * number, np.uint8), format="rgb24")
            picture.pts, picture.time_base = time_ms, Fraction(1, 1000)
            container.mux(stream.encode(picture))
        container.mux(stream.encode())


def read(path: str, *options: str) -> list[int]:
    frames = imageio_ffmpeg.read_frames(path, output_params=list(options))
    next(frames)  # describes the film
    return [round((float(np.frombuffer(frame, np.uint8).mean()) - 20) / 25) for frame in frames]


for path in ("film.mp4", "film.mkv"):
    write(path)
    counted, all_read = imageio_ffmpeg.count_frames_and_secs(path)[0], read(path)
    passed = read(path, "-fps_mode", "passthrough")
    print(path, counted, len(all_read), all_read, passed)
    assert counted == 8 and passed == list(range(8))
    assert all_read == [0, 1, 3, 3, 4, 5, 6, 7] if path == "film.mp4" else len(all_read) == 47
EOF
