"""The latency of players that show `/video.mjpg`, in periods of the camera: `--players`.

A camera draws the number of each picture in six stripes. Each player decodes the served video, and
writes what it shows as grey pixels; a browser draws it on a canvas.
"""

from __future__ import annotations

import os
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from robot.clock import RealClock
from robot.testing import FakeCamera
from robot.types import Frame
from server.access.player_key import PlayerKey
from server.config import Config
from tests.server.live_robot import WEB, live_server

WIDTH, HEIGHT, BITS = 160, 120, 6
RATE_HZ = 10.0
NOBODY, VLC_LINE = 65534, b"FRAME\n"
PICTURES = 60
"""Number of pictures that each player shows before the median is computed."""

BY_OPENCV = """
import sys, cv2
video = cv2.VideoCapture(sys.argv[1])
while True:
    is_there, picture = video.read()
    if not is_there:
        break
    sys.stdout.buffer.write(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY).tobytes())
    sys.stdout.buffer.flush()
"""
IN_A_BROWSER = """
url => new Promise((resolve, reject) => {
  const image = new Image(), canvas = document.createElement('canvas');
  canvas.width = 160; canvas.height = 120;
  const context = canvas.getContext('2d', {willReadFrequently: true}), seen = [];
  image.crossOrigin = 'anonymous';
  image.onerror = () => reject(new Error('the picture cannot be loaded'));
  document.body.append(image);
  image.src = url;
  const look = () => {
    if (image.naturalWidth) {
      context.drawImage(image, 0, 0);
      const row = context.getImageData(0, 60, 160, 1).data;
      let number = 0;
      for (let bit = 0; bit < 6; bit++) {
        number |= (row[4 * Math.floor((bit + .5) * 160 / 6)] > 127) << bit;
      }
      if (!seen.length || seen.at(-1)[0] !== number) seen.push([number, Date.now() / 1000]);
    }
    if (seen.length > 60) resolve(seen); else requestAnimationFrame(look);
  };
  look();
})
"""


class NumberedCamera(FakeCamera):
    """Shows numbers, and notes when each picture was taken, in seconds of the wall clock."""

    def __init__(self) -> None:
        numbers = range(1 << BITS)
        super().__init__(RealClock(), rate_hz=RATE_HZ, pictures=[_draw(n) for n in numbers])
        self.taken_s: dict[int, float] = {}

    def take(self) -> Frame:
        self.taken_s[self._last_frame_id % (1 << BITS)] = time.time()
        return super().take()


def _draw(number: int) -> bytes:
    bits = [255 * (number >> bit & 1) for bit in range(BITS)]
    row = np.array([bits[x * BITS // WIDTH] for x in range(WIDTH)], np.uint8)
    return bytes(cv2.imencode(".jpg", np.tile(row, (HEIGHT, 1)))[1])


def _read(grey: bytes) -> int:
    row = np.frombuffer(grey, np.uint8).reshape(HEIGHT, WIDTH)[HEIGHT // 2]
    return sum(int(row[int((bit + 0.5) * WIDTH / BITS)] > 127) << bit for bit in range(BITS))


def players() -> dict[str, list[str]]:
    """Return each player on this machine, with the command that writes grey pixels."""
    raw = ["-f", "rawvideo", "-pix_fmt", "gray", "-"]
    quick = ["-fflags", "nobuffer", "-probesize", "32", "-analyzeduration", "0"]
    ffmpeg = ["ffmpeg", "-v", "error"]
    vlc = ["cvlc", "-q", "--no-audio", "--vout=yuv", "--yuv-file=/dev/stdout", "--yuv-chroma=GREY"]
    pipe = "souphttpsrc location=URL is-live=true ! multipartdemux ! jpegdec ! videoconvert"
    gst = f"gst-launch-1.0 -q {pipe} ! video/x-raw,format=GRAY8 ! fdsink sync=false fd=1"
    found = {
        "ffmpeg": [*ffmpeg, "-i", "URL", *raw],
        "ffmpeg, low delay": [*ffmpeg, *quick, "-f", "mpjpeg", "-i", "URL", "-vsync", "0", *raw],
        "OpenCV": [sys.executable, "-c", BY_OPENCV, "URL"],
        "GStreamer": gst.split(),
        "VLC": [*vlc, "URL"],
        "VLC, --network-caching=0": [*vlc, "--network-caching=0", "URL"],
    }
    return {name: words for name, words in found.items() if shutil.which(words[0])}


def _by_program(words: list[str], url: str) -> list[tuple[int, float]]:
    """Return the numbers that a program shows, with the times at which it wrote them."""
    command = [word.replace("URL", url) for word in words]
    seen: list[tuple[int, float]] = []
    given: dict[str, Any] = {"stderr": subprocess.DEVNULL, "stdout": subprocess.PIPE}
    if words[0] == "cvlc" and os.geteuid() == 0:  # VLC does not run as root
        given |= {"user": NOBODY, "env": {**os.environ, "HOME": "/tmp"}}
    with subprocess.Popen(command, **given) as running:
        assert running.stdout is not None
        if words[0] == "cvlc":
            os.fchmod(running.stdout.fileno(), 0o666)  # VLC recognises it by its suffix
            running.stdout.readline()
        while len(seen) <= PICTURES and len(grey := running.stdout.read(WIDTH * HEIGHT)):
            if words[0] == "cvlc":  # a line precedes each picture
                grey = (grey + running.stdout.read(len(VLC_LINE)))[len(VLC_LINE) :]
            seen.append((_read(grey), time.time()))
        running.kill()
    return seen


def _by_chromium(url: str) -> list[tuple[int, float]]:
    from tests.e2e.world import running_chromium

    with running_chromium() as browser:
        page = browser.new_page()
        seen: list[Any] = page.evaluate(IN_A_BROWSER, url)
        return [(number, at_s) for number, at_s in seen]


def measure(folder: Path) -> Iterator[str]:
    """Serve, and yield a line for each player: latency in periods, median and largest tenth."""
    camera = NumberedCamera()
    with live_server(Config(port=0, web=WEB, data=folder), camera, data=folder) as server:
        url = f"{server.address}/video.mjpg?key={PlayerKey(folder).replace()}"
        ways: dict[str, Callable[[], list[tuple[int, float]]]] = {
            name: lambda words=words: _by_program(words, url)  # type: ignore[misc]
            for name, words in players().items()
        }
        ways["Chromium, <img> of another site"] = lambda: _by_chromium(url)
        for name, watch in ways.items():
            late = []
            for number, at_s in watch()[PICTURES // 2 :]:
                behind = (at_s - camera.taken_s.get(number, at_s)) * RATE_HZ
                late.append(behind % (1 << BITS))
            if late:
                tenth = statistics.quantiles(late, n=10)[-1]
                yield f"{name:32} {statistics.median(late):5.2f} {tenth:5.2f}"
            else:
                yield f"{name:32} showed nothing"
