"""The sample firmware, on Debian's micropython: driven, killed, frozen, flooded and attacked."""

from __future__ import annotations

import hashlib
import hmac
import json
import socket
from collections.abc import Iterator
from typing import Any

import pytest

from robot.driver import ACTION_TIMEOUT_S
from robot.drivers.remote.driver import RemoteOptions
from robot.drivers.udp import UdpDriver
from robot.errors import DriveError
from robot.types import Action
from tests.standins.firmware import FIRMWARE, SECRET, FirmwareRobot


def test_it_is_short() -> None:
    assert len(FIRMWARE.read_text().splitlines()) <= 60


@pytest.fixture
def robot() -> Iterator[FirmwareRobot]:
    with FirmwareRobot() as running:
        yield running


@pytest.fixture
def sender(robot: FirmwareRobot) -> Iterator[Sender]:
    with Sender(robot) as sending:
        yield sending


def driver_for(robot: FirmwareRobot, secret: str = SECRET) -> UdpDriver:
    return UdpDriver(RemoteOptions(address=robot.address, secret=secret))


class Sender:
    """Sends what a driver would not, and reads the reports."""

    def __init__(self, robot: FirmwareRobot) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(60.0)
        self.socket.connect(("127.0.0.1", robot.port))
        self.report: dict[str, Any] = {}
        self.ask(b"{}")

    def __enter__(self) -> Sender:
        return self

    def __exit__(self, *error: object) -> None:
        self.socket.close()

    def ask(self, message: bytes) -> dict[str, Any]:
        self.socket.send(message)
        self.report = json.loads(self.socket.recv(600))
        return self.report

    def order(self, secret: str = SECRET, **fields: Any) -> bytes:
        plain = {"move": "forward", "for_ms": 400, "speed": 1.0, "seq": 1, **fields}
        plain.setdefault("seen_ms", self.report["ms"])
        text = json.dumps(plain).encode()
        key, nonce = secret.encode(), self.report["nonce"].encode()
        mac = hmac.new(key, nonce + text, hashlib.sha256).hexdigest()[:16]
        return text + b"\t" + mac.encode()


@pytest.mark.realtime
def test_moves_turn_the_wheels_and_end_by_themselves(robot: FirmwareRobot) -> None:
    with driver_for(robot) as driver:
        driver.send_action(Action.LEFT, speed_scale=0.5)
        robot.wait_until_it_stands()
    turned = [move[1:] for move in robot.moves if any(move[1:])]
    assert turned == [(-0.25, 0.25)]
    began_s = next(move[0] for move in robot.moves if any(move[1:]))
    stood_s = next(move[0] for move in robot.moves if move[0] > began_s)
    assert stood_s - began_s >= ACTION_TIMEOUT_S - 0.1, "it does not stop before its time"


@pytest.mark.realtime
def test_a_wrong_secret_moves_nothing_and_is_told(robot: FirmwareRobot) -> None:
    driver = driver_for(robot, "wrong")
    with driver, pytest.raises(DriveError, match="--secret"):
        for _ in range(10):
            driver.send_action(Action.FORWARD)
    assert not any(any(move[1:]) for move in robot.moves)


@pytest.mark.realtime
def test_replayed_forged_and_late_orders_move_nothing(robot: FirmwareRobot, sender: Sender) -> None:
    order = sender.order(seq=5)
    assert sender.ask(order)["seq"] == 5
    robot.wait_until_it_stands()
    moves = len(robot.moves)
    assert sender.ask(order)["seq"] == 5  # replayed
    sender.ask(sender.order(seq=4))
    sender.ask(sender.order(secret="other", seq=9))
    sender.ask(sender.order(seq=9).replace(b"400", b"900"))
    assert sender.report["seq"] == 5 and len(robot.moves) == moves
    late = sender.order(seq=10, seen_ms=sender.report["ms"] - 600)
    assert sender.ask(late)["seq"] == 10
    robot.wait_until_it_stands()
    assert not any(any(move[1:]) for move in robot.moves[moves:]), "a late order only stops"


RUBBISH = (b"", b"\x00\xff", b"[]\t", b"7", b"{", b'{"seq": 1}\tx', b"x" * 500, b"null\t0")
NONSENSE: tuple[dict[str, Any], ...] = ({"speed": "x"}, {"move": 7}, {"for_ms": None}, {"seq": "1"})


@pytest.mark.realtime
def test_rubbish_and_signed_nonsense_are_answered_and_harmless(sender: Sender) -> None:
    seq = 0
    for message in RUBBISH:
        assert sender.ask(message)["seq"] == seq, message
        seq += 1
        assert sender.ask(sender.order(seq=seq))["seq"] == seq, message
    for fields in NONSENSE:
        sender.ask(sender.order(**{"seq": seq + 1, **fields}))
        seq += 2
        assert sender.ask(sender.order(seq=seq))["seq"] == seq, fields


@pytest.mark.realtime
def test_a_flood_does_not_keep_it_from_standing(robot: FirmwareRobot, sender: Sender) -> None:
    sender.ask(sender.order(for_ms=60_000))  # half a second is the most
    for _ in range(20_000):
        sender.socket.send(b"flood")
    robot.wait_until_it_stands()


@pytest.mark.realtime
def test_after_a_freeze_it_stands_before_it_obeys(robot: FirmwareRobot, sender: Sender) -> None:
    sender.ask(sender.order())
    stale = sender.order(seq=2)
    robot.freeze()
    sender.socket.send(stale)
    sender.socket.settimeout(0.7)
    with pytest.raises(TimeoutError):
        sender.socket.recv(600)
    robot.thaw()
    robot.wait_until_it_stands()
    sender.socket.settimeout(60.0)
    assert json.loads(sender.socket.recv(600))["seq"] == 2
    assert [any(move[1:]) for move in robot.moves] in ([True, False], [True, False, False])


@pytest.mark.realtime
def test_a_robot_that_was_switched_off_and_on_is_driven_again(robot: FirmwareRobot) -> None:
    with driver_for(robot) as driver:
        driver.send_action(Action.FORWARD)
        robot.__exit__()
        with pytest.raises(DriveError, match="not answered"):
            for _ in range(100):
                driver.send_action(Action.FORWARD)
        robot.__enter__()
        for _ in range(200):
            try:
                driver.send_action(Action.FORWARD)
                break
            except DriveError:
                continue
        driver.send_action(Action.LEFT)
        assert driver.send_action(Action.LEFT) is Action.LEFT
        assert robot.is_moving()
