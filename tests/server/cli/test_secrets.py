"""No recording, file or answer contains the value of an option that is declared secret."""

import argparse
import base64
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import pytest

from robot.devices.options import options_of
from robot.devices.plugins import CAMERAS, DRIVERS, load_camera, load_driver
from server.cli.serve import _recorded
from tests.kit.described import readable_addresses
from tests.kit.run import run
from tests.kit.served import served
from tests.kit.sizes import few
from tests.own_plugins import own_plugins
from tests.server.live_robot import Pilot
from tests.standins.mjpeg import MjpegServer

SECRET = "hunter2zebra" * 3
LOOKS = (SECRET.encode(), base64.b64encode(f"user:{SECRET}".encode())[:24])
PLACES = {"address": "127.0.0.1:9", "brick": "127.0.0.1"}
"""An address without a server, for options that name a host."""
URLS = ("http://user:{}@127.0.0.1:9/x", "http://127.0.0.1:9/x?key={}", "ftp://user:{}@x/", "{}@x",
        "http://user:{}@[::1/x", "http://user:{}@127.0.0.1:99999/x")  # fmt: skip
KINDS: list[tuple[str, Any]] = [
    *(("--robot", load_driver(name)) for name in own_plugins(DRIVERS)),
    *(("--camera", load_camera(name)) for name in own_plugins(CAMERAS)),
]


@pytest.mark.parametrize(("flag", "kind"), KINDS, ids=lambda it: getattr(it, "name", it))
def test_a_secret_is_not_recorded(flag, kind):
    options = options_of(kind.options_type)
    args = argparse.Namespace(port=8000, **{one.name: SECRET for one in options})
    rig: Any = SimpleNamespace(driver=object.__new__(kind), camera=object.__new__(kind))
    recorded = {one.name for one in options if not one.is_secret}
    assert set(_recorded(args, rig)) == {"port", *recorded}


def test_these_options_are_secret():
    options = [one for _, kind in KINDS for one in options_of(kind.options_type)]
    secrets = {"source", "secret", "brick_secret"} & {one.name for one in options}
    assert {one.name for one in options if one.is_secret} == secrets


@pytest.mark.slow
@pytest.mark.realtime
def test_no_secret_leaves_a_real_server(tmp_path):
    for number, words in enumerate(few(_commands(), 2)):
        _check_a_start_that_fails(words, tmp_path / str(number))
    _check_a_drive(tmp_path / "drive")


def _commands() -> Iterator[list[str]]:
    """Generate command lines from the declared options, with a value for each secret option."""
    for flag, kind in KINDS:
        options = options_of(kind.options_type)
        known = [one for one in options if one.name in PLACES]
        places = [word for one in known for word in (one.flag, PLACES[one.name])]
        for one in options:
            for value in URLS if one.name == "source" else ("{}",):
                if one.is_secret:
                    yield [flag, kind.name, *places, one.flag, value.format(SECRET)]


def _check_a_start_that_fails(words: list[str], folder: Path) -> None:
    command = [sys.executable, "-m", "server", "-v", "--port", "0", "--data", str(folder), *words]
    done = run(*command, timeout=60, text=False)
    assert done.returncode in (1, 2) and b"Traceback" not in done.stderr, (words, done.stderr)
    _search(" ".join(words[:2]), done.stdout + done.stderr)
    _search_files(folder)


def _check_a_drive(folder: Path) -> None:
    """Drive, record and save with a server, lose its camera, read all addresses, and end it."""
    with MjpegServer() as camera:
        source = camera.address.replace("http://", f"http://user:{SECRET}@")
        words = ("-v", "--robot", "sim", "--camera", "mjpeg", "--source", source)
        with served(folder, *words) as server, httpx.Client(base_url=server.address) as client:
            with Pilot(server.drive_url, sees=True) as pilot:
                pilot.drive_until(lambda: pilot.state["lessons"] > 10)
                client.post("/api/models/save", json={})
                client.post("/api/models", json={"name": 3})
                camera.refuses = True
                pilot.wait_for_state(mode="stopped")
                _search("websocket", repr(pilot.messages).encode())
            answers = [client.get(address) for address in readable_addresses(client)]
            # On a busy machine, /healthz may report a stalled loop, which is a valid answer.
            assert sum(answer.status_code in (200, 503) for answer in answers) > 20
        for answer in answers:
            _search(str(answer.url), repr(answer.headers).encode() + answer.content)
    _search("terminal", "".join(server.said + server.errors).encode())
    assert list(folder.glob("episodes/*.mcap")) and list(folder.glob("models/*/*.npz"))
    _search_files(folder)


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
