"""The latency of players that show `/video.mjpg`, in periods of the camera: `--players`.

A camera draws the number of each picture in six stripes. Each player decodes the served video, and
writes what it shows as grey pixels; a browser draws it on a canvas.
"""

from __future__ import annotations

import json
import os
import queue
import re
import shutil
import signal
import socket
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import urlsplit

import cv2
import numpy as np

from robot.clock import RealClock
from robot.testing import FakeCamera
from robot.types import Frame
from server.access.player_key import PlayerKey
from server.config import Config
from tests.server.live_robot import WEB, live_server

WIDTH, HEIGHT, BITS = 160, 120, 6
SHOWN = 80
"""Number of rows after which the number is complete: a C program may keep the last rows of a
picture in its output buffer until the next."""
RATE_HZ = 10.0
NOBODY, VLC_LINE = 65534, b"FRAME\n"
PICTURES = 60
"""Number of pictures that each player shows before the median is computed."""
STALL_S = 15

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
PAGE = """<!doctype html><img crossorigin="anonymous" src="URL"><script>
const image = document.querySelector('img'), canvas = document.createElement('canvas'), seen = [];
canvas.width = 160; canvas.height = 120;
const context = canvas.getContext('2d', {willReadFrequently: true});
const tell = () => fetch('/', {method: 'POST', body: JSON.stringify(seen)});
image.onerror = tell;
const look = async () => {
  if (image.naturalWidth) {
    context.drawImage(await createImageBitmap(image), 0, 0);  // Firefox draws <img> only once
    const row = context.getImageData(0, 60, 160, 1).data;
    let number = 0;
    for (let bit = 0; bit < 6; bit++) {
      number |= (row[4 * Math.floor((bit + .5) * 160 / 6)] > 127) << bit;
    }
    if (!seen.length || seen.at(-1)[0] !== number) seen.push([number, Date.now() / 1000]);
  }
  if (seen.length > PICTURES) tell(); else requestAnimationFrame(look);
};
look();
</script>"""


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
    picture = np.random.default_rng(number).integers(0, 256, (HEIGHT, WIDTH), np.uint8)
    picture = cv2.GaussianBlur(picture, (3, 3), 0)
    picture[HEIGHT // 3 : SHOWN] = row
    return bytes(cv2.imencode(".jpg", picture)[1])


def _read(grey: bytes) -> int:
    row = np.frombuffer(grey, np.uint8).reshape(-1, WIDTH)[HEIGHT // 2]
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


def _as_its_user(program: str) -> dict[str, Any]:
    """Return the options of a process: VLC does not run as root."""
    if program != "cvlc" or os.geteuid() != 0:
        return {}
    return {"user": NOBODY, "env": {**os.environ, "HOME": "/tmp"}}


def _by_program(words: list[str], url: str) -> list[tuple[int, float]]:
    """Return the numbers that a program shows, with the times at which it wrote them."""
    command = [word.replace("URL", url) for word in words]
    seen: list[tuple[int, float]] = []
    given = {"stderr": subprocess.DEVNULL, "stdout": subprocess.PIPE, **_as_its_user(words[0])}
    with subprocess.Popen(command, **given) as running:
        assert running.stdout is not None
        header = 0
        if words[0] == "cvlc":
            os.fchmod(running.stdout.fileno(), 0o666)  # VLC recognises it by its suffix
            running.stdout.readline()
            header = len(VLC_LINE)  # a line precedes each picture
        while len(seen) <= PICTURES and len(running.stdout.read(header)) == header:
            shown = running.stdout.read(WIDTH * SHOWN)
            at_s = time.time()
            running.stdout.read(WIDTH * (HEIGHT - SHOWN))
            if len(shown) < WIDTH * SHOWN:
                break
            if not seen or seen[-1][0] != _read(shown):  # VLC also repeats pictures
                seen.append((_read(shown), at_s))
        running.kill()
    return seen


def browsers() -> dict[str, list[str]]:
    """Return each browser on this machine, with the command that opens an address."""
    from tests.e2e.world import CHROMIUM_FLAGS, CHROMIUMS

    found = {"Firefox": ["firefox-esr", "--headless", "--no-remote", "--profile", "HOME", "URL"]}
    if chromium := next(filter(shutil.which, CHROMIUMS), None):
        found["Chromium"] = [chromium, *CHROMIUM_FLAGS, "--user-data-dir=HOME", "URL"]
    return {name: words for name, words in found.items() if shutil.which(words[0])}


def _by_browser(words: list[str], url: str) -> list[tuple[int, float]]:
    """Return the numbers that an `<img>` of another site shows, with the times."""
    told = queue.Queue[bytes]()

    class Site(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self._answer(PAGE.replace("URL", url).replace("PICTURES", str(PICTURES)))

        def do_POST(self) -> None:
            told.put(self.rfile.read(int(self.headers["content-length"])))
            self._answer("")

        def _answer(self, page: str) -> None:
            self.send_response(200)
            self.send_header("content-type", "text/html")
            self.end_headers()
            self.wfile.write(page.encode())

        def log_message(self, format: str, *args: object) -> None: ...

    with ThreadingHTTPServer(("127.0.0.1", 0), Site) as site, TemporaryDirectory() as home:
        serving = threading.Thread(target=site.serve_forever)
        serving.start()
        here = f"http://127.0.0.1:{site.server_port}/"
        given = [word.replace("HOME", home).replace("URL", here) for word in words]
        none = subprocess.DEVNULL
        browser = subprocess.Popen(given, start_new_session=True, stdout=none, stderr=none)
        try:
            return [(number, at_s) for number, at_s in json.loads(told.get(timeout=120))]
        finally:
            os.killpg(browser.pid, signal.SIGTERM)
            browser.wait()
            site.shutdown()
            serving.join()


def _held_by_a_viewer_that_stalls(address: str) -> int:
    """Return how many old pictures a viewer finds that has not read for some seconds."""
    where = urlsplit(address)
    with closing(socket.create_connection((where.hostname, where.port))) as viewer:
        viewer.sendall(b"GET /video.mjpg HTTP/1.1\r\nHost: localhost\r\n\r\n")
        reads_until_s = time.monotonic() + STALL_S
        while time.monotonic() < reads_until_s:
            viewer.recv(1 << 16)
        time.sleep(STALL_S)
        viewer.setblocking(False)
        held = b""
        with suppress(BlockingIOError):
            while part := viewer.recv(1 << 16):
                held += part
    return held.count(b"--frame")


def _version(program: str) -> str:
    """Return the version that a program says."""
    if program == sys.executable:
        return cv2.__version__
    given = _as_its_user(program)
    said = subprocess.run(
        [program, "--version"], capture_output=True, text=True, check=False, **given
    )
    told = (said.stdout + said.stderr).replace(program, "")  # gst-launch-1.0
    found = re.search(r"\d+\.[\w.]+", told)
    return found[0] if found else "?"


def measure(folder: Path) -> Iterator[str]:
    """Serve, and yield a line for each player: latency in periods, median and largest tenth."""
    camera = NumberedCamera()
    with live_server(Config(port=0, web=WEB, data=folder), camera, data=folder) as server:
        url = f"{server.address}/video.mjpg?key={PlayerKey(folder).replace()}"
        found = [(*named, _by_program) for named in players().items()]
        found += [(*named, _by_browser) for named in browsers().items()]
        for name, words, watch in found:
            late = []
            for number, at_s in watch(words, url)[PICTURES // 2 :]:
                behind = (at_s - camera.taken_s.get(number, at_s)) * RATE_HZ
                late.append(behind % (1 << BITS))
            told = "showed nothing"
            if late:
                tenth = statistics.quantiles(late, n=10)[-1]
                told = f"{statistics.median(late):5.2f} {tenth:5.2f}"
            yield f"{name:26} {_version(words[0]):16} {told}"
        held = _held_by_a_viewer_that_stalls(server.address)
        yield f"a viewer that stalls for {STALL_S} s holds {held} pictures"
