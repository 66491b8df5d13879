"""Whatever becomes of the server, the motors stand, by themselves.

How soon is judged in virtual time: each move that they are told ends within 400 ms (here), and
the contract of drivers cuts the line to the brick.
"""

from __future__ import annotations

import os
import re
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import pytest

from robot.testing.brick import FakeBrick
from tests.brick.film import ROOT, install_film
from tests.brick.running_agent import SECRET, RunningAgent
from tests.server.live_robot import Pilot

PATIENCE_S = 30.0


class Proxy:
    """A line that can be cut (both ends hear of it) or go silent (nobody does)."""

    def __init__(self, address: str) -> None:
        host, port = address.split(":")
        self._target = (host, int(port))
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self._listener.getsockname()[1]}"
        self._lines: list[socket.socket] = []
        self._is_silent = threading.Event()
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        with suppress(OSError, ValueError):  # it was cut or closed
            self._pass_on()

    def _pass_on(self) -> None:
        near, _ = self._listener.accept()
        far = socket.create_connection(self._target)
        self._lines = [near, far]
        other = {near: far, far: near}
        while not self._is_silent.is_set():
            for line in select.select(self._lines, [], [], 0.05)[0]:
                data = line.recv(65536)
                if not data:
                    return
                other[line].sendall(data)

    def go_silent(self) -> None:
        self._is_silent.set()

    def cut(self) -> None:
        self.go_silent()
        for line in self._lines:
            line.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self._is_silent.set()
        for line in [self._listener, *self._lines]:
            line.close()


@contextmanager
def serving(folder: Path, *options: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A server as a process of its own; yields it and its address."""
    install_film(folder / "film")
    command = [
        sys.executable,
        "-m",
        "server",
        "serve",
        "--camera",
        "film",
        "--film",
        str(folder / "film/film.yuyv"),
        "--frame-rate",
        "20",
        "--learner",
        "published",
        "--port",
        "0",
        "--data",
        str(folder / "data"),
        *options,
    ]
    env = {**os.environ, "PYTHONPATH": str(folder / "film"), "OPENBLAS_NUM_THREADS": "1"}
    process = subprocess.Popen(
        command, cwd=ROOT, env=env, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert process.stdout is not None
    try:
        match = None
        while match is None:
            line = process.stdout.readline()
            assert line, "the server ended"
            match = re.search(r"http://(\S+)", line)
        yield process, f"ws://{match[1]}"
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


class Drive:
    """A robot under way: a pilot holds forward, and the wheels turn."""

    def __init__(
        self, brick: FakeBrick, process: subprocess.Popen[str], proxy: Proxy | None, pilot: Pilot
    ) -> None:
        self.brick, self.process, self.proxy, self.pilot = brick, process, proxy, pilot

    def check_it_stands_after(self, harm: Callable[[], None]) -> None:
        """The motors stand by the timed command that they had, and are told no other."""
        full = self.brick.speeds
        self.pilot.drive_until(lambda: set(full().values()) == {360})
        harm()
        self.brick.wait_until(lambda: not self.brick.is_moving(), PATIENCE_S)
        time.sleep(1.0)  # what was on its way has arrived, however busy the machine is
        self.brick.wait_until(lambda: not self.brick.is_moving(), PATIENCE_S)
        moves = [c for c in self.brick.commands if c.command.startswith("run")]
        time.sleep(0.5)
        assert not self.brick.is_moving()
        later = self.brick.commands[self.brick.commands.index(moves[-1]) + 1 :]
        assert {command.command for command in later} <= {"stop"}
        assert {(move.command, move.time_ms) for move in moves} == {("run-timed", 400)}


@pytest.fixture(params=["ev3", "ev3-remote"])
def drive(request: pytest.FixtureRequest, brick: FakeBrick, tmp_path: Path) -> Iterator[Drive]:
    with ExitStack() as stack:
        proxy = None
        if request.param == "ev3":
            options = ["--brick-root", str(brick.root)]
        else:
            proxy = Proxy(stack.enter_context(RunningAgent(brick.root, tmp_path)).address)
            stack.callback(proxy.close)
            options = ["--brick", proxy.address, "--brick-secret", SECRET]
        process, address = stack.enter_context(
            serving(tmp_path, "--robot", request.param, *options)
        )
        pilot = stack.enter_context(Pilot(address + "/ws/drive"))
        pilot.wait_for_state(you_are_pilot=True)
        pilot.drive_until(lambda: set(brick.speeds().values()) == {360})
        yield Drive(brick, process, proxy, pilot)


@pytest.mark.realtime
def test_killing_the_server(drive: Drive) -> None:
    drive.check_it_stands_after(drive.process.kill)


@pytest.mark.realtime
def test_freezing_the_server(drive: Drive) -> None:
    drive.check_it_stands_after(lambda: drive.process.send_signal(signal.SIGSTOP))


@pytest.mark.realtime
@pytest.mark.parametrize("drive", ["ev3-remote"], indirect=True)
def test_cutting_the_line(drive: Drive) -> None:
    assert drive.proxy is not None
    drive.check_it_stands_after(drive.proxy.cut)


@pytest.mark.realtime
@pytest.mark.parametrize("drive", ["ev3-remote"], indirect=True)
def test_a_line_that_goes_silent(drive: Drive) -> None:
    assert drive.proxy is not None
    drive.check_it_stands_after(drive.proxy.go_silent)


@pytest.mark.realtime
@pytest.mark.parametrize("drive", ["ev3-remote"], indirect=True)
def test_ending_the_server_in_good_order(drive: Drive) -> None:
    drive.process.terminate()
    drive.process.wait(60)
    drive.brick.wait_until(lambda: not drive.brick.is_moving(), PATIENCE_S)
    drive.brick.catch_up()
    assert drive.brick.commands[-1].command == "stop"
