"""Runs the agent's own code in virtual time, on a thread of the clock, with connections in
memory."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, Self

from robot.bodies.ev3.agent.server import Agent
from robot.bodies.ev3.driver import Ev3Driver
from robot.bodies.ev3.fake_brick import FakeBrick
from robot.bodies.ev3.handshake import PATIENCE_S
from robot.bodies.ev3.link import BrickLink
from robot.bodies.v4l2.device import VideoFrame
from robot.clock import Clock, Worker

ADDRESS, SECRET = "brick:8765", "a shared secret"
_HOLDS_BYTES = 65_536
"""Maximum number of unread bytes in one direction of a connection, like a socket's buffer."""
_TICK_S = 0.0002
"""Duration of the agent's tick; without it, a busy agent would block other threads forever."""


class Net:
    """The agent's connections; an event on any connection wakes all waiting threads."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self._waiting: set[threading.Event] = set()

    def wait_for(self, is_so: Callable[[], object], timeout_s: float | None) -> bool:
        """Wait until a condition holds; False if it does not hold in time."""
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
    """One end of a connection, used like a socket; with `timeout_s` 0 it does not wait.

    While `is_deaf`, it receives nothing; while `is_mute`, all that it sends is lost.
    """

    def __init__(self, net: Net, timeout_s: float | None) -> None:
        self.net, self.timeout_s = net, timeout_s
        self.inbox = bytearray()
        self.is_closed = self.is_deaf = self.is_mute = False
        self.peer: End = self

    @property
    def is_readable(self) -> bool:
        hears = not self.is_deaf and (self.inbox or self.peer.is_closed)
        return self.is_closed or bool(hears)

    @property
    def is_writable(self) -> bool:
        return len(self.peer.inbox) < _HOLDS_BYTES or self.peer.is_closed or self.is_closed

    def _wait_for(self, is_so: Callable[[], bool]) -> None:
        if not self.net.wait_for(is_so, self.timeout_s):
            raise TimeoutError("timed out") if self.timeout_s else BlockingIOError()

    def recv(self, size: int) -> bytes:
        self._wait_for(lambda: self.is_readable)
        if self.is_deaf:
            return b""
        data = bytes(self.inbox[:size])
        del self.inbox[:size]
        self.net.poke()
        return data

    def send(self, data: bytes) -> int:
        if self.is_mute:
            return len(data)
        self._wait_for(lambda: self.is_writable)
        if self.is_closed or self.peer.is_closed:
            raise BrokenPipeError(32, "Broken pipe")
        sent = data[: _HOLDS_BYTES - len(self.peer.inbox)]
        self.peer.inbox += sent
        self.net.poke()
        return len(sent)

    def sendall(self, data: bytes) -> None:
        while data:
            data = data[self.send(data) :]

    def settimeout(self, seconds: float | None) -> None:
        self.timeout_s = seconds

    def setblocking(self, is_blocking: bool) -> None:
        self.timeout_s = None if is_blocking else 0.0

    def setsockopt(self, *option: int) -> None:
        """There is nothing to set."""

    def close(self, how: int = 0) -> None:
        self.is_closed = True
        self.net.poke()

    shutdown = close


def connected(net: Net, patience_s: float = PATIENCE_S) -> tuple[End, End]:
    """Return both ends of a connection: one that waits, and the agent's, which does not."""
    near, far = End(net, patience_s), End(net, 0.0)
    near.peer, far.peer = far, near
    return near, far


class Listener:
    """The listener at which connections arrive; `accept` first raises the `errors`."""

    def __init__(self, *errors: OSError) -> None:
        self.arrived: deque[End] = deque()
        self.errors = list(errors)
        self.address = "127.0.0.1"

    @property
    def is_readable(self) -> bool:
        return bool(self.arrived)

    def accept(self) -> tuple[End, tuple[str, int]]:
        if self.errors:
            raise self.errors.pop(0)
        if not self.arrived:
            raise BlockingIOError
        return self.arrived.popleft(), (self.address, 50_000)

    def close(self, *_: object) -> None:
        """There is nothing to close, or to set."""

    setblocking = setsockopt = close


class VirtualAgent:
    """A context manager, used like `RunningAgent`; the brick's clock must be virtual."""

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
            self._listener,
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
        """Open a connection to the agent."""
        if self._thread is None or f"{address[0]}:{address[1]}" != ADDRESS:
            raise ConnectionRefusedError(111, "Connection refused")
        if self._is_cut:
            self.net.clock.sleep(PATIENCE_S)
            raise TimeoutError("timed out")
        near, far = connected(self.net)
        self._dialled.append(near)
        self._listener.arrived.append(far)
        self.net.poke()
        return near

    def cut(self) -> None:
        """Cut all connections without a notice: no message arrives any more in any direction."""
        self._is_cut = True
        for near in self._dialled:
            near.is_mute = near.is_deaf = True

    def mend(self) -> None:
        """Allow new connections; cut connections stay cut, because TCP retries too seldom."""
        self._is_cut = False

    def deafen(self, is_deaf: bool = True) -> None:
        """Hold back the agent's messages, as while the computer is paused, or deliver them."""
        for near in self._dialled:
            near.is_deaf = is_deaf
        self.net.poke()

    def hang_up(self) -> None:
        """Close all connections from the server's side, as the system does for a killed process."""
        self.cut()
        for near in self._dialled:
            near.close()

    def kill(self) -> None:
        """End like a killed process: no motor is stopped, and the kernel closes the connections."""
        self._end()
        for caller in self._agent._limiter.callers:
            caller.line.close()

    def start_again(self) -> None:
        """Continue like an agent that was restarted after the kill, and that nobody has joined."""
        for caller in list(self._agent._limiter.callers):
            self._agent._drop(caller, "killed")
        self._ending.clear()
        self.__enter__()

    def __enter__(self) -> Self:
        self._thread = self.net.clock.start_thread(self._serve, "agent")
        return self

    def __exit__(self, *error: object) -> None:
        if self._thread is not None:
            self._end()
            self._agent.close()

    def _end(self) -> None:
        assert self._thread is not None
        self._ending.set()
        self.net.poke()
        self._thread.join()
        self._thread = None

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


def close_motor(driver: Ev3Driver, side: int) -> None:
    """Pull out a motor's cable: here, open files outlive their folder, but on a brick, the next
    write fails with ENODEV."""
    for file in driver._connection.motors._ports[side]._files.values():
        file.close()


class SimulatedCamera:
    """Replaces `CameraReader`: 30 pictures a second; can be frozen and thawed."""

    width, height, encoding, path = 32, 24, "yuyv", "/dev/video0"
    is_readable = False

    def __init__(self) -> None:
        self.is_frozen = False
        self.fault: str | None = None
        self.video = self
        self._due_s = 0.0
        self._index = 0

    def open(self, *wanted: object) -> Self:
        """Note that the agent has opened the camera."""
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
        """There is nothing to close."""
