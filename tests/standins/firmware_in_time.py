"""Runs the sample firmware and the hub's program in virtual time, in this Python.

The stand-ins for `machine`, `network` and `pybricks` are those of the tests with Debian's
micropython, but use the virtual clock, so thousands of moments can be tested.
"""

from __future__ import annotations

import builtins
import operator
import random
import threading
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from robot.clock import Worker
from robot.testing import VirtualClock
from tests.standins.firmware import FIRMWARE, firmware
from tests.standins.pybricks_hub import PROGRAM

HERE = Path(__file__).parent


def modules(**found: Any) -> dict[str, Any]:
    """Return globals whose `import` finds these modules first."""

    def find(name: str, *args: Any) -> Any:
        return found[name] if name in found else builtins.__import__(name, *args)

    return {"__builtins__": {**vars(builtins), "__import__": find}, "__name__": "program"}


def load(file: str, **found: Any) -> SimpleNamespace:
    """Load a module of this folder, which imports these modules; its printed lines are dropped."""
    names = modules(**found)
    names["print"] = lambda *words: None
    exec(compile((HERE / file).read_text(), file, "exec"), names)
    return SimpleNamespace(**names)


class OverError(BaseException):
    """Ends a program that would run forever."""


class Box:
    """Messages in transit to one side, each with a delay of its own."""

    def __init__(self, clock: VirtualClock) -> None:
        self._clock = clock
        self._waiting: deque[tuple[float, bytes]] = deque()
        self._news = threading.Event()

    def put(self, data: bytes, delay_s: float) -> None:
        """Send a message; messages arrive in the order of sending."""
        last_s = self._waiting[-1][0] if self._waiting else 0.0
        self._waiting.append((max(last_s, self._clock.now_s() + delay_s), data))
        self._news.set()

    def take(self, timeout_s: float) -> bytes | None:
        """Return the next message that arrives within `timeout_s`."""
        end_s = self._clock.now_s() + timeout_s
        while True:
            now_s = self._clock.now_s()
            if self._waiting and self._waiting[0][0] <= now_s:
                return self._waiting.popleft()[1]
            if now_s >= end_s:
                return None
            due_s = min(end_s, self._waiting[0][0] if self._waiting else end_s)
            self._news.clear()
            self._clock.wait(self._news, due_s - now_s)


class RunningProgram:
    """A program on a board. `is_moving` tells whether its wheels turn, and `line` is a
    `MessageLine` to it.

    Args:
        clock: The clock of the program, the wheels and the messages.
        seed: Seed of the random time that each message takes.
    """

    def __init__(self, clock: VirtualClock, seed: int) -> None:
        self.clock = clock
        self._random = random.Random(seed)
        self.to_board, self.to_server = Box(clock), Box(clock)
        self.is_lost = False
        self.slowest_s = 0.08
        self._is_over = False
        self._thread: Worker | None = None
        self.time = SimpleNamespace(
            ticks_ms=lambda: int(1000 * clock.now_s()),
            ticks_diff=operator.sub,
            ticks_add=operator.add,
            sleep_ms=self._sleep_ms,
        )

    def start(self) -> None:
        self._thread = self.clock.start_thread(self._run, "board")

    def end(self) -> None:
        self._is_over = True
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        try:
            self._execute()
        except OverError:
            return

    def _execute(self) -> None:
        raise NotImplementedError

    def _sleep_ms(self, time_ms: int) -> None:
        self.check_over()
        self.clock.sleep(time_ms / 1000)

    def check_over(self) -> None:
        if self._is_over:
            raise OverError

    def send(self, box: Box, data: bytes) -> None:
        if not self.is_lost:
            box.put(data, self._random.uniform(0.0005, self.slowest_s))

    @property
    def wheels(self) -> tuple[float, float]:
        """The motion of the left and the right wheel."""
        raise NotImplementedError

    @property
    def is_moving(self) -> bool:
        return any(self.wheels)

    def line(self) -> Any:
        """Return the server's end."""
        return SimpleNamespace(
            send=lambda message: self.send(self.to_board, message),
            receive=self.to_server.take,
            close=lambda: None,
        )


class RunningFirmware(RunningProgram):
    """Runs docs/examples/firmware/robot.py; `pins` are the motors' pins: left ahead, left back,
    right ahead, right back."""

    pins: Sequence[int] = ()

    @property
    def wheels(self) -> tuple[float, float]:
        ahead, back, right_ahead, right_back = self.pins or (0, 0, 0, 0)
        return (ahead - back) / 65535, (right_ahead - right_back) / 65535

    def _execute(self) -> None:
        def poll(timeout_ms: int) -> list[int]:
            self.check_over()
            self._next = self.to_board.take(timeout_ms / 1000)
            return [] if self._next is None else [1]

        sock = SimpleNamespace(
            bind=lambda address: None,
            recvfrom=lambda size: (self._next, "server"),
            sendto=lambda data, to: self.send(self.to_server, data),
        )
        poller = SimpleNamespace(register=lambda *_: None, poll=poll)
        machine = load("board_modules/machine.py", time=self.time)
        names = modules(
            machine=machine,
            network=load("board_modules/network.py"),
            time=self.time,
            select=SimpleNamespace(poll=lambda: poller, POLLIN=1),
            socket=SimpleNamespace(
                socket=lambda *_: sock,
                AF_INET=2,
                SOCK_DGRAM=2,
                getaddrinfo=lambda *_: [("0.0.0.0", 4210)],
            ),
        )
        self.pins = machine.duties
        names["print"] = lambda *words: None
        exec(compile(firmware(b"geheim", 4210), str(FIRMWARE), "exec"), names)


class RunningHub(RunningProgram):
    """Runs docs/examples/firmware/hub.py; the hub's firmware ends the motors' moves."""

    def __init__(self, clock: VirtualClock, seed: int) -> None:
        super().__init__(clock, seed)
        self._told = {"A": (0.0, 0.0), "B": (0.0, 0.0)}
        self._typed = b""

    @property
    def wheels(self) -> tuple[float, float]:
        now_s = self.clock.now_s()
        left, right = (speed * (now_s < ends_s) for speed, ends_s in self._told.values())
        return -left, right  # the left motor is mounted the other way round

    def line(self) -> Any:
        line = super().line()
        line.send = lambda message: self.send(self.to_board, message + b"\n")
        return line

    def _execute(self) -> None:
        def write(text: str) -> None:
            what, port, *numbers = text.split()
            if what == "\x01motor":
                speed, run_ms = map(float, numbers)
                self._told[port] = speed, self.clock.now_s() + run_ms / 1000

        def poll(_: int) -> list[int]:
            self._typed += self.to_board.take(0.0) or b""
            return [1] if self._typed else []

        def read(count: int) -> bytes:
            data, self._typed = self._typed[:count], self._typed[count:]
            return data

        def told(*words: Any) -> None:
            self.send(self.to_server, " ".join(map(str, words)).encode())

        poller = SimpleNamespace(register=lambda _: None, poll=poll)
        found: dict[str, Any] = {
            "time": self.time,
            "sys": SimpleNamespace(stdout=SimpleNamespace(write=write)),
            "uselect": SimpleNamespace(poll=lambda: poller),
            "usys": SimpleNamespace(stdin=SimpleNamespace(buffer=SimpleNamespace(read=read))),
        }
        for part in ("parameters", "hubs", "pupdevices", "tools"):
            found[f"pybricks.{part}"] = load(f"hub_modules/pybricks/{part}.py", **found)
        names = modules(**found)
        names["print"] = told
        exec(compile(PROGRAM.read_text(), str(PROGRAM), "exec"), names)
