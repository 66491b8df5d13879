"""A process that has imported all modules of a robot, and forks robots on request.

Thirty robots that import their modules separately take 30 CPU seconds to start, and share no
memory. Here one process imports the modules, and its forks share its memory. Each robot is still a
separate process, so a crash of one robot does not affect the others. The nursery reads lines of
JSON on its standard input and answers on its standard output. The nursery runs only on Linux,
because on other systems a process that has loaded a robot's modules must not be forked.
"""

from __future__ import annotations

import contextlib
import gc
import json
import math
import os
import queue
import random
import select
import signal
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from robot.clock import RealClock

END_S = 15.0
"""How long a robot may take to exit before it is killed, in seconds."""
BELOW = 5
"""Niceness of the robots: the board and the browsers have priority."""
_POLL_S = 1.0
_COLD = 6.0
"""Factor by which a robot in a class needs more CPU time than `measure_picture_s` returns. In a
class, caches are cold, sockets and the disk add time, and a tenth of the computer must stay free
for a STOP. Measured with thirty robots on two cores."""
_BATCHES, _BATCH = 5, 20
"""To measure this computer's speed, process this many batches with this many pictures each. Only
the fastest batch counts, because other programs can slow a batch down but not speed it up."""
_MODULES = (
    *("anyio._backends._asyncio", "anyio._core._fileio", "cv2", "encodings.ascii"),
    *("encodings.idna", "encodings.utf_8_sig", "fastapi.telemetry._runtime", "filelock"),
    *("google.protobuf", "google.protobuf.descriptor_pb2", "google.protobuf.message_factory"),
    *("google.protobuf.timestamp_pb2", "mcap.reader"),
    *("mcap.writer", "numpy.ma", "numpy.random", "panda3d.core", "platformdirs.unix"),
    *("pydantic.dataclasses", "resource", "segno", "zeroconf", "zstandard"),
    *("uvicorn.lifespan.on", "uvicorn.logging", "uvicorn.loops.asyncio"),
    *("uvicorn.protocols.http.h11_impl", "robot.devices.rig", "robot.simulator.camera"),
    *("robot.policy.registry", "server.app", "server.cli.main", "server.cli.serve"),
    *("server.coaching.gallery_routes", "server.coaching.routes", "server.coaching.word_routes"),
    *("server.hosting.serving", "server.hosting.starting_page", "server.integrations.fastpath"),
    *("server.integrations.metrics", "server.integrations.mjpeg", "server.integrations.unread"),
    *("server.persistence", "server.recordings.retraining_routes"),
    *("server.recordings.routes",),
)
"""Modules that are imported before the robots are forked, so that all robots share them in memory.
A module that is missing here is imported by each robot separately, into the robot's own memory. A
test checks that no module of Drivelesson is missing."""

_ARENAS = "1"
"""Number of heaps of glibc's allocator. By default each thread gets its own heap, which keeps some
megabytes of freed memory. A robot has 14 threads, but only one of them runs Python at a time, so
one heap is enough."""


class Nursery:
    """Starts the nursery, which is the process that forks the robots, and sends requests to it.

    Attributes:
        picture_s: CPU time in seconds that a trained robot of a class needs for one picture on this
            computer; None if it could not be measured.
    """

    def __init__(self, folder: Path, world: str) -> None:
        life, self._life = os.pipe()
        self._process = subprocess.Popen(
            [sys.executable, "-m", __name__, str(folder), world, str(life)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pass_fds=[life],
            start_new_session=True,
            text=True,
            env={"MALLOC_ARENA_MAX": _ARENAS, **os.environ},
        )
        os.close(life)
        self._lock = threading.Lock()
        self._started: queue.Queue[int | None] = queue.Queue()
        self._ended: dict[int, threading.Event] = {}
        assert self._process.stdout is not None
        first = self._process.stdout.readline()
        self.picture_s: float | None = json.loads(first)["picture_s"] if first else None
        self._listening = threading.Thread(target=self._listen, daemon=True)
        self._listening.start()

    def start(self, words: Sequence[str], log: Path) -> threading.Event | None:
        """Fork a robot. Return an event that is set when the robot ends; None if the robot did not
        start."""
        with self._lock, contextlib.suppress(OSError):
            assert self._process.stdin is not None
            self._process.stdin.write(json.dumps({"words": list(words), "log": str(log)}) + "\n")
            self._process.stdin.flush()
            pid = self._started.get()
            return None if pid is None else self._ended[pid]
        return None

    def end(self) -> None:
        """Tell all robots to end; they also end by themselves when the calling process ends."""
        if self._life >= 0:
            os.close(self._life)
            self._life = -1
            assert self._process.stdin is not None
            with contextlib.suppress(OSError):
                self._process.stdin.close()

    def wait(self) -> None:
        """Wait until all robots have ended; kill the nursery if this takes too long."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(END_S + 5.0)
        self._process.kill()
        self._process.wait()
        self._listening.join(1.0)
        if self._process.stdout is not None:
            self._process.stdout.close()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            told = json.loads(line)
            if "started" in told:
                self._ended[told["started"]] = threading.Event()
                self._started.put(told["started"])
            else:
                self._ended[told["ended"]].set()
        self._started.put(None)


def _serve(words: Sequence[str], log: str, life: int) -> int:
    """Run a robot in this process until the robot or the class ends; return the exit status."""
    gc.enable()
    os.setsid()
    os.nice(BELOW)
    random.seed()
    for source, fds in ((os.open(os.devnull, os.O_RDONLY), (0,)), (_log(log), (1, 2))):
        for fd in fds:
            os.dup2(source, fd)
    signal.signal(signal.SIGINT, signal.default_int_handler)

    def end_with_class() -> None:
        while os.read(life, 1):
            pass
        signal.raise_signal(signal.SIGINT)

    threading.Thread(target=end_with_class, daemon=True).start()
    from server.cli.main import main

    return main(["serve", *words])


def _log(path: str) -> int:
    return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)


def _fork(work: Callable[[], int]) -> int:
    """Do the work in a separate process; return its process id."""
    sys.stdout.flush()
    pid = os.fork()
    if pid:
        return pid
    status = 1
    try:
        status = work()
    except BaseException as error:
        if isinstance(error, SystemExit):
            status = error.code if isinstance(error.code, int) else int(error.code is not None)
        else:
            traceback.print_exc()
    finally:
        with contextlib.suppress(Exception):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(
            status
        )  # `sys.exit` would run exit handlers that the parent process registered before the fork


def measure_picture_s(world: str) -> float:
    """Return the CPU time to render, encode, decode, predict and learn one picture, in seconds."""
    from robot.control.loop import ControlLoop
    from robot.policy.registry import make_policy
    from robot.simulator.camera import SimCamera, SimCameraOptions
    from robot.simulator.driver import SimDriver, SimOptions
    from robot.types import Action, Mode, PilotCommand

    clock, body = RealClock(), SimDriver(SimOptions(world=world))
    body.connect()
    camera = SimCamera(body, SimCameraOptions(), clock)
    loop = ControlLoop(body, camera, make_policy("default-32"), clock)
    moves = (Action.FORWARD, Action.LEFT, Action.FORWARD, Action.RIGHT)
    least_s, start_s = math.inf, 0.0
    for number in range(_BATCHES * _BATCH):
        if number % _BATCH == 0:
            start_s = time.thread_time()
        body.advance(0.1)
        frame, now_s = camera.take_jpeg(), clock.now_s()
        if loop.mode is not Mode.TRAIN:
            loop.set_mode(Mode.TRAIN)
        held = moves[number // 10 % 4]
        loop.command(
            PilotCommand(held=held, frame_id=frame.frame_id, seq=number + 1, received_s=now_s)
        )
        loop.tick(now_s)
        if number % _BATCH == _BATCH - 1:
            least_s = min(least_s, time.thread_time() - start_s)
    return least_s / _BATCH


def _measure_apart(world: str) -> float | None:
    """Call `measure_picture_s` in a child process. The nursery's own process must not render
    pictures, because afterwards it could no longer fork robots."""
    read, write = os.pipe()

    def work() -> int:
        os.write(write, json.dumps(measure_picture_s(world)).encode())
        return 0

    pid = _fork(work)
    os.close(write)
    found = os.read(read, 64)
    os.close(read)
    os.waitpid(pid, 0)
    return _COLD * json.loads(found) if found else None


def _run(world: str, life: int) -> None:
    """Import the modules, fork robots until the input ends, and wait until they have ended."""
    import importlib

    # Do not free memory before the fork. Each robot would allocate in the freed pages, and Linux
    # would then copy these pages for each robot.
    gc.disable()
    for name in _MODULES:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    from robot.devices.rig import build_rig
    from robot.policy.registry import make_policy
    from server.app import create_app
    from server.cli.main import make_parser
    from server.config import Config
    from server.hosting.serving import websocket_protocol
    from server.services import Services

    make_policy("default-32")  # this and the next three calls fill caches that all robots share
    websocket_protocol()
    usual = vars(make_parser("serve", is_extended=False).parse_args([]))  # plugins' options, too
    app = create_app(Services(Config(port=0), build_rig("sim"), options=usual))
    for route in app.routes:  # FastAPI prepares a route when it first matches a URL
        route.matches({"type": "http", "method": "GET", "path": "/", "headers": []})
    gc.freeze()
    _say(picture_s=_measure_apart(world))
    clock = RealClock()
    running: set[int] = set()
    until_s: float | None = None
    waiting = ""
    while running or until_s is None:
        if until_s is None and select.select([0], [], [], _POLL_S)[0]:
            read = os.read(0, 1 << 16).decode()
            waiting += read
            until_s = None if read else clock.now_s() + END_S
        elif until_s is not None:
            clock.sleep(0.05)
        *lines, waiting = waiting.split("\n")
        for line in lines:
            told: dict[str, Any] = json.loads(line)
            pid = _fork(lambda told=told: _serve(told["words"], told["log"], life))  # type: ignore[misc]
            running.add(pid)
            _say(started=pid)
        for pid in list(running):
            if os.waitpid(pid, os.WNOHANG)[0]:
                running.discard(pid)
                _say(ended=pid)
            elif until_s is not None and clock.now_s() > until_s:
                os.kill(pid, signal.SIGKILL)


def _say(**words: Any) -> None:
    with contextlib.suppress(OSError):  # the reader has ended
        sys.stdout.write(json.dumps(words) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _run(sys.argv[2], int(sys.argv[3]))
