#!/bin/sh
# aiortc 1.16.0 (av 18.1.0): MediaRecorder silently stops recording an MP4 if two pictures arrive within one thirtieth
# of a second.
#
# Guess before running: all pictures of a camera are recorded with their times, at any frame rate, or surplus pictures
# are dropped.
# Outcome: wrong. Times are rounded to 1/30 s. Two pictures then have the same time, and the file refuses the second
# one. The recording task ends with this error, which nobody reads, and the camera continues. Ten seconds become a
# film of less than five if the camera gives 30.3 pictures a second, or 30 with a single extra picture in between. If
# it happens within the first two seconds, stop() raises an error, and the file cannot be opened. A Matroska file
# contains all pictures, some with equal times. A camera with exactly 30 pictures a second is recorded completely, so
# a short test passes.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check aiortc==1.16.0 av==18.1.0 numpy==2.4.6
cd "$folder"
"$folder/env/bin/python" -W ignore - 2>errors <<'PY' || { cat errors; exit 1; }
import asyncio
from fractions import Fraction

import av
import numpy as np
from aiortc import MediaStreamError, MediaStreamTrack
from aiortc.contrib.media import MediaRecorder


class Camera(MediaStreamTrack):
    kind = "video"

    def __init__(self, times_s: list[float]) -> None:
        super().__init__()
        self.times_s, self.taken = times_s, 0

    async def recv(self) -> av.VideoFrame:
        if self.taken == len(self.times_s):
            self.stop()
            raise MediaStreamError
        await asyncio.sleep(0.002)
        picture = av.VideoFrame.from_ndarray(np.full((120, 160, 3), self.taken % 250, np.uint8), format="rgb24")
        picture.pts, picture.time_base = round(self.times_s[self.taken] * 90_000), Fraction(1, 90_000)
        self.taken += 1
        return picture


async def record(name: str, times_s: list[float]) -> tuple[int, float | None, str]:
    camera, recorder, raised = Camera(times_s), MediaRecorder(name), "nothing"
    recorder.addTrack(camera)
    await recorder.start()
    before = -1
    while before != camera.taken:  # until the recorder takes no more pictures
        before = camera.taken
        await asyncio.sleep(1)
    try:
        await recorder.stop()
    except av.FFmpegError as error:
        raised = type(error).__name__
    try:
        with av.open(name) as film:
            last_s = max(float(picture.time) for picture in film.decode(video=0))
    except av.FFmpegError:
        last_s = None
    return camera.taken, last_s, raised


def at(rate: float) -> list[float]:
    return [number / rate for number in range(300)]


films = {
    "30.mp4": at(30),
    "30.3.mp4": at(30.3),
    "31.mp4": at(31),
    "31.mkv": at(31),
    "one more.mp4": sorted([*at(30), 3.003]),
}
found = {name: asyncio.run(record(name, times_s)) for name, times_s in films.items()}
print("pictures taken, time of the last in the film, raised by stop()", found)
assert found["30.mp4"][0] == found["31.mkv"][0] == 300 and found["30.mp4"][1] > 9.9 and found["31.mkv"][1] > 9.6
for name in ("30.3.mp4", "one more.mp4"):
    assert found[name][0] < 250 and 3 < found[name][1] < 8 and found[name][2] == "nothing"
assert found["31.mp4"][0] < 250 and found["31.mp4"][1:] == (None, "ArgumentError")
PY
