"""No file and no answer contains the value of an option that is declared secret.

`test_process_faults.py` runs this.
"""

from __future__ import annotations

import base64
import re
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx

from robot.devices.options import options_of
from robot.devices.plugins import CAMERAS, DRIVERS, load_camera, load_driver
from tests.kit.sizes import few
from tests.own_plugins import own_plugins
from tests.server.live_robot import Pilot
from tests.server.own_process import own_process
from tests.standins.mjpeg import MjpegServer

SECRET = "hunter2zebra" * 3
LOOKS = (SECRET.encode(), base64.b64encode(f"user:{SECRET}".encode())[:24])
PLACES = {"address": "127.0.0.1:9", "brick": "127.0.0.1"}
"""An address at which nothing answers, for options that name a host."""
URLS = ("http://user:{}@127.0.0.1:9/x", "http://127.0.0.1:9/x?key={}", "ftp://user:{}@x/", "{}@x",
        "http://user:{}@[::1/x", "http://user:{}@127.0.0.1:99999/x")  # fmt: skip


def check_no_secret_leaves(tmp_path: Path) -> None:
    for number, words in enumerate(few(_commands(), 3)):
        _check_a_start_that_fails(words, tmp_path / str(number))
    _check_a_drive(tmp_path / "drive")


def _commands() -> Iterator[list[str]]:
    """Generate command lines from the declared options, with a value for each secret option."""
    for flag, names, load in (
        ("--robot", own_plugins(DRIVERS), load_driver),
        ("--camera", own_plugins(CAMERAS), load_camera),
    ):
        for name in names:
            options = options_of(load(name).options_type)
            known = [one for one in options if one.name in PLACES]
            places = [word for one in known for word in (one.flag, PLACES[one.name])]
            for one in options:
                for value in URLS if one.name == "source" else ("{}",):
                    if one.is_secret:
                        yield [flag, name, *places, one.flag, value.format(SECRET)]


def _check_a_start_that_fails(words: list[str], folder: Path) -> None:
    command = [sys.executable, "-m", "server", "-v", "--port", "0", "--data", str(folder), *words]
    done = subprocess.run(command, capture_output=True, timeout=60, check=False)
    assert done.returncode in (1, 2) and b"Traceback" not in done.stderr, (words, done.stderr)
    _search(" ".join(words[:2]), done.stdout + done.stderr)
    _search_files(folder)


def _check_a_drive(folder: Path) -> None:
    """Drive, record, save, lose the camera, read every address, and end."""
    with MjpegServer() as camera:
        source = camera.address.replace("http://", f"http://user:{SECRET}@")
        words = ("-v", "--robot", "sim", "--camera", "mjpeg", "--source", source)
        with own_process(folder, *words) as server, httpx.Client(base_url=server.address) as client:
            with Pilot(server.address.replace("http", "ws") + "/ws/drive", sees=True) as pilot:
                pilot.drive_until(lambda: pilot.state["lessons"] > 10)
                client.post("/api/models/save", json={})
                client.post("/api/models", json={"name": 3})
                camera.refuses = True
                pilot.wait_for_state(mode="stopped")
                _search("websocket", repr(pilot.messages).encode())
            answers = [client.get(address) for address in _addresses(client)]
            # On a busy machine /healthz reports that the loop stalls, which is a valid answer.
            assert sum(answer.status_code in (200, 503) for answer in answers) > 20
        for answer in answers:
            _search(str(answer.url), repr(answer.headers).encode() + answer.content)
    _search("terminal", "".join(server.said + server.errors).encode())
    assert list(folder.glob("episodes/*.mcap")) and list(folder.glob("models/*/*.npz"))
    _search_files(folder)


def _addresses(client: httpx.Client) -> Iterator[str]:
    listed = client.get("/api/episodes").text + client.get("/api/models").text
    names = {"1", *re.findall(r'"(?:id|name)":\s*"([\w-]+)"', listed)}
    paths: dict[str, Any] = client.get("/openapi.json").json()["paths"]
    for path, ways in paths.items():
        if "get" in ways and path != "/video.mjpg":
            for name in names if "{" in path else {""}:
                yield re.sub(r"\{\w+\}", name, path)


def _search_files(folder: Path) -> None:
    for path in folder.rglob("*"):
        if path.is_file():
            _search(str(path), path.read_bytes())
        if path.suffix in (".npz", ".zip"):
            with zipfile.ZipFile(path) as archive:
                for name in archive.namelist():
                    _search(f"{path}: {name}", archive.read(name))


def _search(where: str, data: bytes) -> None:
    for look in LOOKS:
        assert look not in data, f"a secret is in {where}"
