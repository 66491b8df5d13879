"""Floods, silence and a relay at the agent harm nobody.

test_agent_process.py tests their cost for a real process.
"""

from __future__ import annotations

import errno
import os
import threading
from contextlib import suppress
from typing import Any

import pytest

from robot.bodies.ev3.agent import callers, wire
from robot.bodies.ev3.fake_brick import FakeBrick
from robot.bodies.ev3.handshake import join
from robot.bodies.ev3.link import BrickLink
from robot.bodies.ev3.remote_driver import Ev3RemoteDriver, Ev3RemoteOptions
from robot.errors import DriveError
from robot.testing import VirtualClock
from robot.types import Action
from tests.robot.bodies.ev3.running_agent import SECRET
from tests.robot.bodies.ev3.virtual_agent import ADDRESS, End, Listener, Net, VirtualAgent


def test_a_caller_that_does_not_authenticate_in_time_is_disconnected(agent: VirtualAgent) -> None:
    clock = agent.net.clock
    line = agent.dial(("brick", 8765))
    line.settimeout(5)
    began_s = clock.now_s()
    for byte in wire.pack_json({"do": "join", "nonce": "a" * 32, "proof": "b"})[:8]:
        line.sendall(bytes([byte]))  # sending a byte from time to time does not help
        clock.sleep(0.1)
    while line.recv(1024):
        pass
    assert clock.now_s() - began_s == pytest.approx(callers.JOIN_S, abs=0.06), "and a tick"
    join(ADDRESS, SECRET, agent.dial).line.close()


def new_line() -> End:
    """Return the agent's end of a connection whose other end does nothing."""
    net = Net(VirtualClock())
    near, far = End(net, None), End(net, 0.0)
    near.peer, far.peer = far, near
    return far


class BrickLine(Listener):
    """A listener whose `accept` fails as often as a test wants, and in the given way."""

    def __init__(self, *numbers: int) -> None:
        super().__init__()
        self.numbers = list(numbers)

    def accept(self) -> Any:
        if self.numbers:
            number = self.numbers.pop(0)
            raise OSError(number, os.strerror(number))
        return super().accept()


@pytest.mark.parametrize(
    "name", ["EMFILE", "ENFILE", "ENOBUFS", "ENOMEM", "ECONNABORTED", "EPERM", "EPROTO", "EINTR"]
)
def test_the_agent_survives_every_error_of_accept(name: str) -> None:
    listener = BrickLine(*[getattr(errno, name)] * 3)
    door = callers.CallerLimiter(listener, print)
    now_s = 100.0
    for _ in range(3):
        assert door.is_open(now_s)
        door.accept(now_s)
        assert not door.is_open(now_s), "the error would come again at once"
        now_s += callers.ACCEPT_PAUSE_S
    listener.arrived.append(new_line())
    door.accept(now_s)
    assert len(door.callers) == 1


def test_a_flood_evicts_only_its_own_connections() -> None:
    listener = Listener()
    left: list[str] = []
    door = callers.CallerLimiter(listener, left.append)
    for index in range(callers.MAX_UNJOINED + 30):
        listener.arrived.append(new_line())
        listener.address = "127.0.0.3" if index == 3 else "127.0.0.2"
        door.accept(float(index))
    assert left == ["127.0.0.2 left: too many others wait to join"] * 30
    assert len(door.callers) == callers.MAX_UNJOINED
    assert "127.0.0.3" in {caller.name for caller in door.callers}


def test_a_flood_does_not_fill_the_card(capsys: pytest.CaptureFixture[str]) -> None:
    log = callers.LimitedLog()
    for index in range(100_000):
        log.note(f"{index} left")
    assert len(capsys.readouterr().out) < 2000


class Relay:
    """An impostor at the brick's address: it relays the handshake, and then changes the
    messages."""

    def __init__(self, agent: VirtualAgent, idea: str) -> None:
        self._agent, self._idea = agent, idea
        self.did = threading.Event()

    def dial(self, address: tuple[str, int]) -> Any:
        net = self._agent.net
        near, ours = End(net, 3.0), End(net, 0.0)
        near.peer, ours.peer = ours, near
        far = self._agent.dial(address)
        net.clock.start_thread(lambda: self._relay(ours, far), "relay")
        return near

    def _relay(self, near: End, far: End) -> None:
        moves: list[bytes] = []
        net = self._agent.net
        with suppress(OSError):
            while net.wait_for(lambda: near.is_readable or far.is_readable, 10.0):
                line = near if near.is_readable else far
                data = line.recv(65536)
                if not data:
                    break
                if line is near and b'"run"' in data:
                    moves.append(data)
                    if self._idea == "steal":
                        forged = {"do": "run", "left": 720, "right": 720, "ms": 500, "after": 0}
                        data = wire.pack_json(forged) + bytes(wire.MAC_SIZE)
                    elif self._idea == "change":
                        data = data.replace(b'"left": ', b'"left":-')
                    elif self._idea == "swallow and repeat":
                        data = moves[0] * 5
                    self.did.set()
                (far if line is near else near).sendall(data)
                if line is near and self._idea == "repeat" and moves:
                    far.sendall(moves[0])
        near.close()
        far.close()


def seen_speeds(brick: FakeBrick) -> set[int]:
    return {command.speed for command in brick.commands if command.command.startswith("run")}


@pytest.mark.parametrize("idea", ["steal", "change", "repeat", "swallow and repeat"])
def test_a_relay_never_drives(brick: FakeBrick, agent: VirtualAgent, idea: str) -> None:
    clock = brick.clock
    relay = Relay(agent, idea)
    link = BrickLink(ADDRESS, SECRET, clock, relay.dial)
    with Ev3RemoteDriver(Ev3RemoteOptions(), link) as driver:
        with suppress(DriveError):
            driver.send_action(Action.FORWARD)
        assert clock.wait(relay.did, 5.0)
        # The agent closes its connection, and the motors stand; only the owner was ever obeyed.
        brick.wait_until(lambda: not brick.is_moving())
        brick.catch_up()
        assert seen_speeds(brick) <= {360}
    with Ev3RemoteDriver(Ev3RemoteOptions(), agent.link()) as driver:
        driver.send_action(Action.FORWARD)
        brick.wait_until(brick.is_moving)


class Impostor:
    """An impostor at the brick's address that does not know the secret but accepts everybody."""

    def __init__(self, clock: VirtualClock) -> None:
        self.clock = clock

    def dial(self, address: tuple[str, int]) -> Any:
        net = Net(self.clock)
        near, ours = End(net, 3.0), End(net, 3.0)
        near.peer, ours.peer = ours, near
        self.clock.start_thread(lambda: self._serve(ours), "impostor")
        return near

    def _serve(self, line: End) -> None:
        line.sendall(wire.pack_json({"hello": wire.PROTOCOL, "nonce": "a" * 32}))
        line.recv(1024)
        line.sendall(wire.pack_json({"welcome": wire.PROTOCOL, "proof": "c" * 64}))
        line.recv(1024)


def test_an_impostor_is_found_out() -> None:
    clock = VirtualClock(100.0)
    link = BrickLink(ADDRESS, SECRET, clock, Impostor(clock).dial)
    with pytest.raises(DriveError, match="could not prove that it knows the shared secret"):
        Ev3RemoteDriver(Ev3RemoteOptions(), link).connect()


def test_a_caller_that_never_reads_is_dropped(agent: VirtualAgent) -> None:
    connection = join(ADDRESS, SECRET, agent.dial)
    connection.line.settimeout(5)
    with pytest.raises(OSError, match="Broken pipe"):
        for _ in range(1000):
            connection.send({"do": "ping", "id": "x" * 8000})
