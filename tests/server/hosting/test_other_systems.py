"""The program works although Windows has other sockets, event loops, clocks and modules."""

import asyncio
import io
import mimetypes
import socket
import subprocess
import sys
from unittest import mock

import pytest

from robot.devices.rig import Rig
from robot.policy.registry import make_policy
from robot.testing import FakeCamera, FakeDriver, VirtualClock
from robot.types import Action
from server.__main__ import main
from server.access.listener import connection_capacity
from server.access.terminal_code import draw_qr
from server.cli.serve import has_screen
from server.hosting import serving
from server.hosting.static_files import CompressedFiles
from tests.server.virtual_server import WEB, VirtualServer

_WITHOUT_LINUX = """
import asyncio, multiprocessing, subprocess, sys, numpy  # they ask for what is gone below
for name in ("fcntl", "resource", "termios", "pwd", "grp", "pty"):
    sys.modules[name] = None
import os
for name in ("uname", "O_NONBLOCK", "O_NOFOLLOW", "O_DIRECTORY", "getuid", "fork"):
    vars(os).pop(name, None)
from robot.devices.plugins import CAMERAS, DRIVERS, load_camera, load_driver
from server.cli.main import main
from tests.own_plugins import own_plugins
for load, group in ((load_driver, DRIVERS), (load_camera, CAMERAS)):
    for name in own_plugins(group):
        load(name)
assert main(["completion", "bash"]) == 0
"""


def test_every_robot_and_camera_is_listed_on_other_systems_than_linux():
    done = subprocess.run(
        [sys.executable, "-c", _WITHOUT_LINUX], capture_output=True, text=True, encoding="utf-8"
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert "drivelesson" in done.stdout


def test_no_other_program_shares_the_port(monkeypatch):
    listener = mock.MagicMock()
    monkeypatch.setattr(serving.socket, "SO_EXCLUSIVEADDRUSE", -5, raising=False)
    monkeypatch.setattr(serving.socket, "socket", lambda *_: listener)
    serving.open_socket("127.0.0.1", 8000)
    calls = [call.args for call in listener.setsockopt.call_args_list]
    assert [option for level, option, _ in calls if level == socket.SOL_SOCKET] == [-5]


def test_the_loop_accepts_through_the_limiting_listener(monkeypatch):
    """Windows' default event loop would ignore the listener's limits."""
    monkeypatch.setattr(asyncio.events, "new_event_loop", lambda: pytest.fail("the system's loop"))
    seen = []

    async def look():
        seen.append(asyncio.get_running_loop())

    serving.run(look())
    assert isinstance(seen[0], asyncio.SelectorEventLoop)
    monkeypatch.setitem(sys.modules, "resource", None)
    assert 32 < connection_capacity() < 512, "Windows can wait for fewer than 512 sockets"


class CoarseClock(VirtualClock):
    """A clock that, like Windows', advances 64 times a second; waits end only at these steps."""

    def now_s(self) -> float:
        return int(super().now_s() * 64) / 64


@pytest.mark.parametrize("rate_hz", [5, 30])
def test_a_clock_of_16_ms_drives_and_stops_as_any_other(rate_hz):
    clock = CoarseClock(100.0)
    rig = Rig(FakeDriver(clock=clock), FakeCamera(clock), make_policy("published-8"), clock)
    with VirtualServer(rig=rig) as server, server.pilot() as pilot:
        pilot.mode("train")
        pilot.hold("forward")
        server.wait_until(lambda: server.driver.now is Action.FORWARD)
        for _ in range(20):
            server.forward(1 / rate_hz)
            assert server.driver.now is Action.FORWARD
        pilot.vanish()
        assert server.wait_until(lambda: server.driver.now is Action.STOP) < 0.5 + 1 / 64


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "gbk"])
def test_a_terminal_with_few_letters_shows_what_it_can(encoding, monkeypatch):
    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding=encoding)
    monkeypatch.setattr(sys, "stdout", stream)
    assert main(["--version"]) == 0
    print(draw_qr("http://192.0.2.1:8000/pair#PPPP-PPPP"), "Zoë 机器人", flush=True)
    assert raw.getvalue().startswith(b"drivelesson ")


@pytest.mark.parametrize(
    ("system", "environment", "is_shown"),
    [
        ("win32", {}, True),
        ("darwin", {}, True),
        ("linux", {"DISPLAY": ":0"}, True),
        ("linux", {"WAYLAND_DISPLAY": "wayland-0"}, True),
        ("linux", {}, False),
        ("linux", {"DISPLAY": ":10", "SSH_CONNECTION": "192.0.2.1"}, False),
        ("darwin", {"SSH_CONNECTION": "192.0.2.1"}, False),
    ],
)
def test_the_page_opens_only_on_a_computer_with_a_screen(system, environment, is_shown):
    assert has_screen(system, environment) is is_shown


def test_scripts_run_even_if_the_registry_calls_them_plain_text():
    mimetypes.add_type("text/plain", ".js")
    scope = {"type": "http", "method": "GET", "headers": []}
    answer = asyncio.run(CompressedFiles(WEB).get_response("board/main.js", scope))
    assert answer.media_type == "text/javascript"
