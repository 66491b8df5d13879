"""The agent in virtual time: its own code on a thread of the clock, with lines in memory."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, Self

from robot.bodies.ev3.agent.server import Agent
from robot.bodies.ev3.fake_brick import FakeBrick
from robot.bodies.ev3.handshake import PATIENCE_S
from robot.bodies.ev3.link import BrickLink
from robot.bodies.v4l2.device import VideoFrame
from robot.clock import Clock, Worker
from tests.robot.bodies.ev3.running_agent import SECRET

ADDRESS = "brick:8765"
_HOLDS_BYTES = 65_536
"""What waits in one direction of a line, as in a socket's buffer."""
_TICK_S = 0.0002
"""What a tick of the agent takes, so that one that is always busy holds up nobody for ever."""


class Net:
    """Whoever waits on a line is woken whenever anything happens on any."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self._waiting: set[threading.Event] = set()

    def wait_for(self, is_so: Callable[[], object], timeout_s: float | None) -> bool:
        """Wait until something is so; False if it is not in time."""
        start_s = self.clock.now_s()
        while not is_so():
            left_s = None if timeout_s is None else start_s + timeout_s - self.clock.now_s()
            if left_s is not None and left_s <= 0:
                return False
            happened = threading.Event()
            self._waiting.add(happened)
            self.clock.wait(happened, left_s)
            self._waiting.discard(happened)
        return True

    def poke(self) -> None:
        for happened in self._waiting:
            happened.set()


class End:
    """One end of a line, used as a socket is; `timeout_s` 0 is one that does not wait."""

    def __init__(self, net: Net, timeout_s: float | None) -> None:
        self.net, self.timeout_s = net, timeout_s
        self.inbox = bytearray()
        self.is_closed = False
        self.peer: End = self

    @property
    def is_readable(self) -> bool:
        return bool(self.inbox) or self.peer.is_closed or self.is_closed

    @property
    def is_writable(self) -> bool:
        return len(self.peer.inbox) < _HOLDS_BYTES or self.peer.is_closed or self.is_closed

    def recv(self, size: int) -> bytes:
        if not self.net.wait_for(lambda: self.is_readable, self.timeout_s):
            raise TimeoutError("timed out") if self.timeout_s else BlockingIOError()
        data = bytes(self.inbox[:size])
        del self.inbox[:size]
        self.net.poke()
        return data

    def send(self, data: bytes) -> int:
        if not self.net.wait_for(lambda: self.is_writable, self.timeout_s):
            raise TimeoutError("timed out") if self.timeout_s else BlockingIOError()
        if self.is_closed or self.peer.is_closed:
            raise BrokenPipeError(32, "Broken pipe")
        sent = data[: _HOLDS_BYTES - len(self.peer.inbox)]
        self.peer.inbox += sent
        self.net.poke()
        return len(sent)

    def hear_nothing(self, size: int) -> bytes:
        """As `recv` where the line was cut."""
        if not self.net.wait_for(lambda: self.is_closed, self.timeout_s):
            raise TimeoutError("timed out") if self.timeout_s else BlockingIOError()
        return b""

    def sendall(self, data: bytes) -> None:
        while data:
            data = data[self.send(data) :]

    def settimeout(self, seconds: float | None) -> None:
        self.timeout_s = seconds

    def setblocking(self, is_blocking: bool) -> None:
        self.timeout_s = None if is_blocking else 0.0

    def setsockopt(self, *option: int) -> None:
        """There is nothing to tune."""

    def shutdown(self, how: int) -> None:
        self.close()

    def close(self) -> None:
        self.is_closed = True
        self.net.poke()


class Listener:
    """Where lines arrive."""

    def __init__(self) -> None:
        self.arrived: deque[End] = deque()
        self.address = "127.0.0.1"

    @property
    def is_readable(self) -> bool:
        return bool(self.arrived)

    def accept(self) -> tuple[End, tuple[str, int]]:
        if not self.arrived:
            raise BlockingIOError
        return self.arrived.popleft(), (self.address, 50_000)

    def setblocking(self, is_blocking: bool) -> None:
        """It never waits."""

    def setsockopt(self, *option: int) -> None:
        """There is nothing to tune."""

    def close(self) -> None:
        """Nothing more arrives."""


class VirtualAgent:
    """A context manager, used as `RunningAgent` is; the brick's clock must be virtual."""

    address = ADDRESS

    def __init__(self, brick: FakeBrick, **options: Any) -> None:
        clock = brick.clock
        self.net = Net(clock)
        self._listener = Listener()
        self._ending = threading.Event()
        self._thread: Worker | None = None
        self._dialled: list[End] = []
        self._is_cut = False
        self._agent = Agent(
            self._listener,  # type: ignore[arg-type]
            SECRET,
            str(brick.root),
            note=lambda text: None,
            clock=SimpleNamespace(monotonic=clock.now_s, sleep=clock.sleep, time=clock.wall_s),
            ready=self._ready,
            **options,
        )

    def link(self, secret: str = SECRET, address: str = ADDRESS) -> BrickLink:
        """Return a link to this agent."""
        return BrickLink(address, secret, self.net.clock, self.dial)

    def dial(self, address: tuple[str, int]) -> Any:
        """Open a line to the agent."""
        if self._thread is None or f"{address[0]}:{address[1]}" != ADDRESS:
            raise ConnectionRefusedError(111, "Connection refused")
        if self._is_cut:
            self.net.clock.sleep(PATIENCE_S)
            raise TimeoutError("timed out")
        near, far = End(self.net, PATIENCE_S), End(self.net, 0.0)
        near.peer, far.peer = far, near
        self._dialled.append(near)
        self._listener.arrived.append(far)
        self.net.poke()
        return near

    def cut(self) -> None:
        """Cut all lines for good: nobody notices, and nothing arrives any more, either way."""
        self._is_cut = True
        for near in self._dialled:
            near.send = len  # type: ignore[method-assign,assignment]
        self.deafen()

    def deafen(self) -> None:
        """Let nothing of what the agent says arrive, as while the computer stands still."""
        for near in self._dialled:
            near.recv = near.hear_nothing  # type: ignore[method-assign]

    def hear_again(self) -> None:
        """Let all arrive that was held up by `deafen`, and what comes after it."""
        for near in self._dialled:
            near.__dict__.pop("recv", None)

    def mend(self) -> None:
        """Let new lines be opened; those that were cut stay so, as TCP waits ever longer."""
        self._is_cut = False

    def hang_up(self) -> None:
        """Close all lines from the server's side, as the system does when its process is killed."""
        self.cut()
        for near in self._dialled:
            near.close()

    def kill(self) -> None:
        """End as a killed process ends: nothing is stopped, the kernel closes the lines."""
        assert self._thread is not None
        self._ending.set()
        self.net.poke()
        self._thread.join()
        self._thread = None
        for caller in self._agent._door.callers:
            caller.line.close()

    def start_again(self) -> None:
        """Go on where it was killed, as an agent that was started anew: nobody has joined."""
        for caller in list(self._agent._door.callers):
            self._agent._drop(caller, "killed")
        self._ending.clear()
        self._thread = self.net.clock.start_thread(self._serve, "agent")

    def __enter__(self) -> Self:
        self._thread = self.net.clock.start_thread(self._serve, "agent")
        return self

    def __exit__(self, *error: object) -> None:
        if self._thread is not None:
            self._ending.set()
            self.net.poke()
            self._thread.join()
            self._thread = None
            self._agent.close()

    def _serve(self) -> None:
        while not self._ending.is_set():
            self._agent.tick()

    def _ready(
        self, readers: list[Any], writers: list[Any], _: list[Any], timeout_s: float
    ) -> tuple[list[Any], list[Any], list[Any]]:
        self.net.clock.sleep(_TICK_S)

        def found() -> tuple[list[Any], list[Any]]:
            return [r for r in readers if getattr(r, "is_readable", False)], [
                w for w in writers if w.is_writable
            ]

        self.net.wait_for(lambda: any(found()) or self._ending.is_set(), timeout_s)
        return (*found(), [])


class MadeUpCamera:
    """In the place of `CameraReader`: 30 pictures a second; can be frozen and comes back."""

    width, height, encoding, path = 32, 24, "yuyv", "/dev/video0"
    is_readable = False

    def __init__(self) -> None:
        self.is_frozen = False
        self.fault: str | None = None
        self.video = self
        self._due_s = 0.0
        self._index = 0

    def open(self, *wanted: object) -> Self:
        """Be opened by the agent."""
        return self

    def poll(self, now_s: float) -> VideoFrame | None:
        """Return a new picture if one is due."""
        self.fault = f"The camera {self.path} gives no pictures" if self.is_frozen else None
        if self.is_frozen or now_s < self._due_s:
            return None
        self._due_s = now_s + 1 / 30
        self._index += 1
        return VideoFrame(bytes([self._index % 256]) * (2 * self.width * self.height), now_s)

    def close(self) -> None:
        """Nothing is open."""
