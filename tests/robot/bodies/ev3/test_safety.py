"""Whatever happens to the server, the motors stop by themselves.

Virtual time checks how soon: each move ends within 400 ms (here), and the contract of drivers cuts
the connection to the brick.
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
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import pytest

from robot.bodies.ev3.fake_brick import FakeBrick
from tests.robot.bodies.ev3.film import ROOT, install_film
from tests.robot.bodies.ev3.running_agent import SECRET, RunningAgent
from tests.server.live_robot import Pilot

PATIENCE_S = 30.0


class Proxy:
    """A connection that can be cut (both ends notice), go silent (neither notices), and be
    restored."""

    def __init__(self, address: str) -> None:
        host, port = address.split(":")
        self._target = (host, int(port))
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self._listener.getsockname()[1]}"
        self._lines: list[socket.socket] = []
        self._is_whole = threading.Event()
        self._is_whole.set()
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        with suppress(OSError, ValueError):  # it was closed
            while True:
                self._is_whole.wait()
                near, _ = self._listener.accept()
                far = socket.create_connection(self._target)
                self._lines += [near, far]
                with suppress(OSError):  # it was cut
                    self._pass_on({near: far, far: near})
                if self._is_whole.is_set():
                    near.close()
                    far.close()

    def _pass_on(self, other: dict[socket.socket, socket.socket]) -> None:
        while self._is_whole.is_set():
            for line in select.select(list(other), [], [], 0.05)[0]:
                data = line.recv(65536)
                if not data:
                    return
                other[line].sendall(data)

    def go_silent(self) -> None:
        self._is_whole.clear()

    def cut(self) -> None:
        self.go_silent()
        self._shut_down()

    def mend(self) -> None:
        """Let the next connection through; both ends of the old one now notice that it is
        closed."""
        self._shut_down()
        self._is_whole.set()

    def _shut_down(self) -> None:
        for line in self._lines:
            with suppress(OSError):
                line.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self._is_whole.clear()
        for line in [self._listener, *self._lines]:
            line.close()
        self._is_whole.set()


@contextmanager
def serving(folder: Path, *options: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A server in a separate process; yields it and its address."""
    install_film(folder / "film")
    words = ["-m", "server", "serve", "--learner", "published", "--port", "0", "--camera", "film"]
    words += ["--film", str(folder / "film/film.yuyv"), "--frame-rate", "20"]
    process, address = start([*words, "--data", str(folder / "data"), *options], folder / "film")
    try:
        yield process, f"ws://{address}"
    finally:
        end(process)


def start(words: list[str], plugins: Path) -> tuple[subprocess.Popen[str], str]:
    """Start it again if it ended: a machine that is paused loses the brick."""
    for _ in range(5):
        process = subprocess.Popen(
            [sys.executable, *words],
            cwd=ROOT,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(plugins)},
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        assert process.stdout is not None
        for line in process.stdout:
            if match := re.search(r"http://(\S+)", line):
                return process, match[1]
        end(process)
    pytest.fail("the server ended")


def end(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.communicate()


class Drive:
    """A robot in motion: a pilot holds forward, and the wheels turn."""

    def __init__(
        self, brick: FakeBrick, process: subprocess.Popen[str], proxy: Proxy | None, pilot: Pilot
    ) -> None:
        self.brick, self.process, self.proxy, self.pilot = brick, process, proxy, pilot

    def check_it_stands_after(self, harm: Callable[[], None]) -> None:
        """Check that the motors stop by their timed command, without another order."""
        brick = self.brick
        self.pilot.drive_until(lambda: set(brick.speeds().values()) == {360})
        harm()
        if self.proxy is not None:  # the agent stops the motors after the last order that arrived
            brick.wait_until(lambda: brick.commands[-1].command == "stop", PATIENCE_S)
        brick.catch_up()
        brick.wait_until(lambda: not brick.is_moving(), PATIENCE_S)
        moves = [command for command in brick.commands if command.command.startswith("run")]
        assert {(move.command, move.time_ms) for move in moves} == {("run-timed", 400)}
        later = brick.commands[brick.commands.index(moves[-1]) + 1 :]
        assert {command.command for command in later} <= {"stop"}

    def freeze(self) -> None:
        self.process.send_signal(signal.SIGSTOP)
        os.waitpid(self.process.pid, os.WUNTRACED)  # from now on it sends nothing

    def freeze_and_thaw(self) -> None:
        self.check_it_stands_after(self.freeze)
        self.process.send_signal(signal.SIGCONT)

    def kill(self) -> None:
        self.process.kill()
        self.process.wait(60)


@contextmanager
def driven(robot: str, brick: FakeBrick, folder: Path) -> Iterator[Drive]:
    """A server in a separate process, whose pilot drives the brick."""
    with ExitStack() as stack:
        proxy = None
        if robot == "ev3":
            options = ["--brick-root", str(brick.root)]
        else:
            proxy = Proxy(stack.enter_context(RunningAgent(brick.root, folder)).address)
            stack.callback(proxy.close)
            options = ["--brick", proxy.address, "--brick-secret", SECRET]
        process, address = stack.enter_context(serving(folder, "--robot", robot, *options))
        pilot = stack.enter_context(Pilot(address + "/ws/drive"))
        pilot.wait_for_state(you_are_pilot=True)
        pilot.drive_until(lambda: set(brick.speeds().values()) == {360})
        yield Drive(brick, process, proxy, pilot)


@pytest.mark.realtime
def test_a_server_on_and_beside_the_brick_is_frozen_cut_off_and_killed_or_ends_in_good_order(
    real_brick: FakeBrick, tmp_path: Path
) -> None:
    a_server_on_the_brick_is_frozen_and_killed(real_brick, tmp_path)
    one_beside_it_is_frozen_cut_off_and_killed_or_ends_in_good_order(real_brick, tmp_path)


def a_server_on_the_brick_is_frozen_and_killed(brick: FakeBrick, tmp_path: Path) -> None:
    with driven("ev3", brick, tmp_path) as drive:
        drive.freeze_and_thaw()
        drive.check_it_stands_after(drive.kill)


def one_beside_it_is_frozen_cut_off_and_killed_or_ends_in_good_order(
    brick: FakeBrick, tmp_path: Path
) -> None:
    with driven("ev3-remote", brick, tmp_path) as drive:
        assert drive.proxy is not None
        drive.freeze_and_thaw()
        for harm in (drive.proxy.cut, drive.proxy.go_silent):
            drive.check_it_stands_after(harm)
            drive.proxy.mend()
        drive.check_it_stands_after(drive.kill)
    with driven("ev3-remote", brick, tmp_path) as drive:
        drive.process.terminate()
        drive.process.wait(60)
        brick.wait_until(lambda: brick.commands[-1].command == "stop", PATIENCE_S)
        brick.wait_until(lambda: not brick.is_moving(), PATIENCE_S)
