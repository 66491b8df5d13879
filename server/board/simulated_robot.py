"""The simulated robots of a class, each in its own process, which ends with the class.

Such a process runs `serve` until its standard input is closed. Every operating system, including
Windows, closes the standard input when the parent process ends, is killed or loses its terminal. So
no robot keeps running without its class. Each process is in a session of its own, so that Ctrl-C
reaches only the class, which then ends the robots.
"""

from __future__ import annotations

import contextlib
import itertools
import logging
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from robot.errors import reason
from robot.store.folder import Storage
from robot.store.models.store import ModelStore
from server.board.nursery import BELOW, END_S, Nursery
from server.cli.main import main
from server.hosting.serving import open_socket
from server.identity import NAMES, IdentityFile

log = logging.getLogger(__name__)
_ASK_S, _ASKS = 0.2, 150
_ANSWER_S = 5.0
_GOLDEN_DEG = 137.508
"""Each robot drives in a simulated room with walls of one colour. The hues of two successive rooms
differ by this angle, in degrees. The golden angle keeps any number of hues distinct."""
_HUES_DEG = {"green": 130, "purple": 259, "pink": 324, "brown": 28, "teal": 176}
"""Hues of the board's colours, in degrees. A robot gets the colour whose hue is nearest to that of
the walls in its simulated room."""
_AT_A_TIME = 4
"""Number of forked robots per CPU core that start at the same time. A core can start several,
because a starting robot spends four fifths of the time waiting until its name is announced."""
RATE_HZ, PER_CORE_HZ = 30, 150
"""`RATE_HZ` is the highest frame rate of one robot. `PER_CORE_HZ` is the highest sum of the frame
rates of all robots, for each CPU core."""
_FLAGS = sum(  # `subprocess` has these flags only on Windows
    getattr(subprocess, name, 0)
    for name in ("CREATE_NEW_PROCESS_GROUP", "BELOW_NORMAL_PRIORITY_CLASS")
)


class SimulatedRobot:
    """One simulated robot.

    The robot's number determines its name, colour and room. If a teacher has changed the
    name or the colour, the robot's folder has the new value.
    """

    def __init__(self, number: int, port: int, folder: Path) -> None:
        self.number, self.port, self.folder = number, port, folder
        self._hue_deg = round(number * _GOLDEN_DEG) % 360
        self._process: subprocess.Popen[bytes] | None = None
        self.model = ""
        """Name of the model with which the robot begins; empty for the model that it used last."""
        self.unsaved_name = ""
        """The robot's name, if it could not be saved; else empty."""
        self.log = folder / "log.txt"
        self._ending, self._has_ended = threading.Event(), threading.Event()
        if not (folder / "robot.json").exists():
            again, place = divmod(number - 1, len(NAMES))
            name = f"{NAMES[place]} {again + 1}" if again else NAMES[place]
            off = {c: (hue - self._hue_deg + 180) % 360 - 180 for c, hue in _HUES_DEG.items()}
            try:
                own = IdentityFile(folder, name)
                own.change(colour=min(off, key=lambda colour: abs(off[colour])))
            except OSError:  # the robots can also be driven if nothing can be saved
                self.unsaved_name = name

    def keep_model(self, name: str, data: bytes) -> None:
        """Save a model in the robot's folder, and let the robot start with it. If the folder
        already has a model of this name, the robot starts with that model."""
        models = ModelStore(Storage(self.folder))
        self.model = name if name in models.names() else models.add_file(name, data)

    def start(
        self, host: str, world: str, key: Path, rate_hz: float, nursery: Nursery | None = None
    ) -> bool:
        """Start the robot's process, and wait until it serves; return False if it never does.

        The output of the process goes to `log.txt` in the robot's folder, if that can be written.
        """
        if self._ending.is_set():
            return False
        self.open_log()
        words = ["--lan", "--host", host, "--port", self.port, "--hostname", f"robot-{self.number}"]
        words += ["--data", self.folder, "--class-key", key, "--world", world]
        words += ["--model", self.model] if self.model else []
        words += ["--name", self.unsaved_name] if self.unsaved_name else []
        words += ["--seed", self.number, "--hue", self._hue_deg, "--frame-rate-hz", rate_hz]
        texts = list(map(str, words))
        if nursery is None:
            self._spawn(texts)
        else:
            self._has_ended = nursery.start(texts, self.log) or self._has_ended
        threading.Thread(target=self._report, daemon=True).start()
        here = "127.0.0.1" if host == "0.0.0.0" else host
        for _ in range(_ASKS):
            if self._ending.wait(_ASK_S) or self._has_ended.is_set():
                return False
            if _serves(here, self.port):
                return True
        return False

    def open_log(self) -> None:
        """Create the robot's log; without a writable folder, its lines are lost."""
        try:
            self.log.open("wb").close()
        except OSError as error:
            log.warning("robot %d runs without its log.txt: %s", self.number, reason(error))
            self.log = Path(os.devnull)

    def _spawn(self, words: list[str]) -> None:
        with self.log.open("wb") as log:
            self._process = process = subprocess.Popen(
                [sys.executable, "-m", __name__, *words],
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                creationflags=_FLAGS,
            )
        self._has_ended = ended = threading.Event()

        def wait() -> None:
            process.wait()
            ended.set()

        threading.Thread(target=wait, daemon=True).start()

    @property
    def is_ending(self) -> bool:
        return self._ending.is_set()

    def end(self) -> None:
        self._ending.set()
        if self._process is not None and self._process.stdin is not None:
            self._process.stdin.close()

    def wait(self) -> None:
        """Wait until the robot's process has ended; kill the process if it hangs."""
        if self._process is not None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(END_S)
            self._process.kill()
            self._process.wait()

    def _report(self) -> None:
        self._has_ended.wait()
        if not self._ending.is_set():
            log.error("robot %d has ended unexpectedly: see %s", self.number, self.log)


def _serves(host: str, port: int) -> bool:
    """Return True if the robot at this address has started. A robot that is still starting answers
    with the status 503."""
    with (
        contextlib.suppress(OSError),
        socket.create_connection((host, port), _ANSWER_S) as line,
    ):
        line.sendall(b"GET /healthz HTTP/1.0\r\nHost: 127.0.0.1\r\n\r\n")
        head = line.recv(64)
        return bool(head) and b" 503 " not in head
    return False


@contextlib.contextmanager
def simulated_robots(
    count: int,
    *,
    host: str,
    port: int,
    data: Path,
    world: str,
    key: Path,
    make_model: Callable[[], tuple[str, bytes]] | None = None,
) -> Iterator[list[int]]:
    """While the `with` block runs, run `count` robots, each in its own room; yield their ports.

    The robots save their data in `data/class`.

    Args:
        count: The number of robots.
        host: The address on which the robots serve.
        port: The board's port; the robots serve on the ports after it.
        data: The data folder of the class.
        world: The simulated world.
        key: The file of the class key.
        make_model: Returns the name and the bytes of the model with which the robots begin.
            It is called once all ports are known to be free. If it is None, the robots keep
            their models.
    """
    robots = [SimulatedRobot(i, port + i, data / "class" / f"{i:02d}") for i in range(1, count + 1)]
    for robot in robots:  # check that all ports are free before the first robot starts
        open_socket(host, robot.port).close()
    if make_model is not None:
        name, file = make_model()
        for robot in robots:
            robot.keep_model(name, file)
    cores = os.cpu_count() or 1
    does_fork = sys.platform == "linux" and count > 1
    # if more robots started at the same time, the board would answer slowly
    starting = ThreadPoolExecutor(cores * (_AT_A_TIME if does_fork else 1))
    nurseries: list[Nursery] = []
    begun, asked = itertools.count(1), itertools.count(1)
    are_up: list[bool] = []

    def begin() -> None:
        """Start all robots while the board already answers."""
        if does_fork:
            nurseries.append(Nursery(data, world))
        picture_s = next((one.picture_s for one in nurseries), None) or 1 / PER_CORE_HZ
        rate_hz = max(1, min(RATE_HZ, int(cores / picture_s / max(1, count))))
        if rate_hz < RATE_HZ:
            text = (
                "%d robots on %d cores: each takes %d pictures a second (%.1f ms of CPU time per "
                "picture), and fewer while other programs are busy"
            )
            log.warning(text, count, cores, rate_hz, 1000 * picture_s)
        for robot in robots:
            starting.submit(start, robot, rate_hz)

    def start(robot: SimulatedRobot, rate_hz: float) -> None:
        sys.stderr.write(f"starting {next(begun)} of {count}\n")
        are_up.append(robot.start(host, world, key, rate_hz, *nurseries))
        if next(asked) == count and not robot.is_ending:
            sys.stderr.write(f"{sum(are_up)} of {count} simulated robots are up\n")

    beginning = threading.Thread(target=begin)
    try:
        beginning.start()
        yield [robot.port for robot in robots]
    finally:
        for robot in robots:
            robot.end()
        beginning.join()
        starting.shutdown(cancel_futures=True)
        for robot in robots:
            robot.end()
        for nursery in nurseries:
            nursery.end()
            nursery.wait()
        for robot in robots:
            robot.wait()


def _end_with_input() -> None:
    while os.read(0, 1):
        pass
    signal.raise_signal(signal.SIGINT)


if __name__ == "__main__":
    # Set the handler, because a shell may start this process with SIGINT ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if hasattr(os, "nice"):
        os.nice(BELOW)
    threading.Thread(target=_end_with_input, daemon=True).start()
    sys.exit(main(["serve", *sys.argv[1:]]))
