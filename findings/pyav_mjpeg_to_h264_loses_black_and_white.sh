#!/bin/sh
# av 18.1.0 (FFmpeg 8.1.2, libx264): the pictures of an MJPEG camera gain contrast when they are encoded as H.264.
#
# Guess before running: a decoded JPEG (full range, 0 to 255) that is given to a stream in yuv420p is converted to
# that stream's range (16 to 235), as the ffmpeg command does, or the film is marked as full range.
# Outcome: wrong for both. The bytes are passed on unchanged, and the film contains no range, so each player assumes
# the limited range. All greys below 16 become black and those above 235 white, 62 becomes 53, and 190 becomes 202. A
# learner that is trained on films, and then drives by the camera's pictures, sees a different world.
# frame.reformat("yuv420p") before encoding does not help. With src_color_range="JPEG", dst_color_range="MPEG" it
# helps, and so does stream.codec_context.color_range = 2.
#
# Our films are made from RGB pixels, so they are not affected.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check av==18.1.0 numpy==2.4.6
cd "$folder"
"$folder/env/bin/python" - <<'PY'
from collections.abc import Callable
from fractions import Fraction

import av
import numpy as np

GREYS = (0, 16, 64, 128, 192, 235, 255)
WIDTH, HEIGHT = 16 * len(GREYS), 64
FULL = 2


def greys(picture: av.VideoFrame) -> list[int]:
    return [int(value) for value in picture.to_ndarray(format="rgb24")[HEIGHT // 2, 8::16, 0]]


def jpeg() -> bytes:
    camera = av.CodecContext.create("mjpeg", "w")
    camera.width, camera.height, camera.pix_fmt = WIDTH, HEIGHT, "yuvj420p"
    camera.time_base, camera.color_range = Fraction(1, 10), FULL
    pixels = np.tile(np.array(GREYS, np.uint8).repeat(16)[None, :, None], (HEIGHT, 1, 3))
    (packet,) = camera.encode(av.VideoFrame.from_ndarray(pixels, format="rgb24").reformat(format="yuvj420p"))
    return bytes(packet)


def in_a_film(change: Callable[[av.VideoFrame], av.VideoFrame], is_full: bool = False) -> tuple[int, list[int]]:
    with av.open("film.mp4", "w") as container:
        stream = container.add_stream("libx264", rate=10, options={"crf": "5"})
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        if is_full:
            stream.codec_context.color_range = FULL
        picture = change(decoded())
        picture.pts, picture.time_base = 0, Fraction(1, 10)
        container.mux(stream.encode(picture))
        container.mux(stream.encode())
    with av.open("film.mp4") as container:
        picture = next(container.decode(video=0))
        return int(picture.color_range), greys(picture)


def decoded() -> av.VideoFrame:
    (picture,) = av.CodecContext.create("mjpeg", "r").decode(av.Packet(taken))
    return picture


taken = jpeg()
true = greys(decoded())
films = {
    "as it is": in_a_film(lambda picture: picture),
    "reformat": in_a_film(lambda picture: picture.reformat(format="yuv420p")),
    "with ranges": in_a_film(
        lambda picture: picture.reformat(format="yuv420p", src_color_range="JPEG", dst_color_range="MPEG")
    ),
    "said to be full": in_a_film(lambda picture: picture, is_full=True),
}
print("camera:", true, "range and greys in films:", films)
errors = {name: max(abs(a - b) for a, b in zip(true, seen, strict=True)) for name, (_, seen) in films.items()}
assert errors["as it is"] > 10 and errors["reformat"] > 10 and films["as it is"][0] == 0
assert errors["with ranges"] < 4 and errors["said to be full"] < 4
PY
