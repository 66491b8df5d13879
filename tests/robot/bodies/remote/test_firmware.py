"""The sample firmware on Debian's micropython is driven, killed, frozen, flooded and attacked."""

from __future__ import annotations

import contextlib
import hashlib
import hmac
import json
import socket
from typing import Any

import pytest

from robot.bodies.remote.driver import RemoteOptions
from robot.bodies.remote.udp import UdpDriver
from robot.driver import ACTION_TIMEOUT_S
from robot.errors import DriveError
from robot.types import Action
from tests.contract.real_parts import as_reported, check_real_driver
from tests.robot.bodies.sending import send_until
from tests.standins.firmware import SECRET, FirmwareRobot


def driver_for(robot: FirmwareRobot, secret: str = SECRET) -> UdpDriver:
    return UdpDriver(RemoteOptions(address=robot.address, secret=secret))


class Sender:
    """A client that sends orders that the driver would never send, and reads the reports."""

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

    def drain(self) -> None:
        """Drop reports that nobody waited for, so that the next report is a new one."""
        self.socket.settimeout(0.5)
        with contextlib.suppress(TimeoutError):
            while True:
                self.socket.recv(600)
        self.socket.settimeout(60.0)
        self.ask(b"{}")

    def order(self, secret: str = SECRET, **fields: Any) -> bytes:
        plain = {"move": "forward", "for_ms": 400, "speed": 1.0, "seq": 1, **fields}
        plain.setdefault("seen_ms", self.report["ms"])
        text = json.dumps(plain).encode()
        key, nonce = secret.encode(), self.report["nonce"].encode()
        mac = hmac.new(key, nonce + text, hashlib.sha256).hexdigest()[:16]
        return text + b"\t" + mac.encode()


RUBBISH = (b"", b"\x00\xff", b"[]\t", b"7", b'{"seq": 1}\tx', b"x" * 500, b"null\t0")
NONSENSE: tuple[dict[str, Any], ...] = ({"speed": "x"}, {"move": 7}, {"for_ms": None}, {"seq": "1"})


@pytest.mark.realtime
def test_the_sample_firmware_drives_and_stops_after_every_fault_and_attack() -> None:
    """The whole test uses one robot, because starting another one takes long."""
    with FirmwareRobot() as robot:
        a_wrong_secret_moves_nothing_and_is_reported(robot)
        driver = driver_for(robot)
        check_real_driver(driver, as_reported(driver, robot.is_moving))
    with FirmwareRobot() as robot:
        moves_turn_the_wheels_and_end_by_themselves(robot)
        with Sender(robot) as sender:
            replayed_forged_and_late_orders_move_nothing(robot, sender)
            nonsense_is_answered_and_harmless(sender)
            a_flood_does_not_delay_the_stop(robot, sender)
            after_a_freeze_the_robot_stops_before_it_obeys(robot, sender)
        the_robot_drives_again_after_a_restart(robot)


def moves_turn_the_wheels_and_end_by_themselves(robot: FirmwareRobot) -> None:
    with driver_for(robot) as driver:
        send_until(driver, Action.LEFT, robot.is_moving, speed_scale=0.5)
        robot.wait_until_it_stands()
    turned = {move[1:] for move in robot.moves if any(move[1:])}
    assert turned == {(-0.25, 0.25)}
    began_s = next(move[0] for move in robot.moves if any(move[1:]))
    stood_s = next(move[0] for move in robot.moves if move[0] > began_s)
    assert stood_s - began_s >= ACTION_TIMEOUT_S - 0.1, "the robot stopped too early"


def a_wrong_secret_moves_nothing_and_is_reported(robot: FirmwareRobot) -> None:
    driver = driver_for(robot, "wrong")
    with driver, pytest.raises(DriveError, match="--secret"):
        for _ in range(10):
            driver.send_action(Action.FORWARD)
    assert not any(any(move[1:]) for move in robot.moves)


def replayed_forged_and_late_orders_move_nothing(robot: FirmwareRobot, sender: Sender) -> None:
    seq = sender.report["seq"] + 5
    order, moves = sender.order(seq=seq), len(robot.moves)
    assert sender.ask(order)["seq"] == seq
    robot.wait_until_it_stands(since=moves)
    moves = len(robot.moves)
    assert sender.ask(order)["seq"] == seq  # a replayed order
    sender.ask(sender.order(seq=seq - 1))
    sender.ask(sender.order(secret="other", seq=seq + 4))
    sender.ask(sender.order(seq=seq + 4).replace(b"400", b"900"))
    assert sender.report["seq"] == seq and len(robot.moves) == moves
    late = sender.order(seq=seq + 5, seen_ms=sender.report["ms"] - 600)
    assert sender.ask(late)["seq"] == seq + 5
    robot.wait_until_it_stands()
    assert not any(any(move[1:]) for move in robot.moves[moves:]), "a late order only stops"


def nonsense_is_answered_and_harmless(sender: Sender) -> None:
    seq = sender.report["seq"]
    for message in RUBBISH:
        assert sender.ask(message)["seq"] == seq, message
        seq += 1
        assert sender.ask(sender.order(seq=seq))["seq"] == seq, message
    for fields in NONSENSE:
        sender.ask(sender.order(**{"seq": seq + 1, **fields}))
        seq += 2
        assert sender.ask(sender.order(seq=seq))["seq"] == seq, fields


def a_flood_does_not_delay_the_stop(robot: FirmwareRobot, sender: Sender) -> None:
    robot.wait_until_it_stands()
    moves = len(robot.moves)
    sender.ask(sender.order(seq=sender.report["seq"] + 1, for_ms=60_000))
    for _ in range(20_000):
        sender.socket.send(b"flood")
    robot.wait_until_it_stands(since=moves)


def after_a_freeze_the_robot_stops_before_it_obeys(robot: FirmwareRobot, sender: Sender) -> None:
    sender.drain()
    seq, moves = sender.report["seq"], len(robot.moves)
    sender.ask(sender.order(seq=seq + 1))
    stale = sender.order(seq=seq + 2)
    robot.freeze()
    sender.socket.send(stale)
    sender.socket.settimeout(0.7)
    with pytest.raises(TimeoutError):
        sender.socket.recv(600)
    robot.thaw()
    robot.wait_until_it_stands(since=moves)
    sender.socket.settimeout(60.0)
    assert json.loads(sender.socket.recv(600))["seq"] == seq + 2
    turned = [any(move[1:]) for move in robot.moves[moves:]]
    assert turned in ([True, False], [True, False, False])


def the_robot_drives_again_after_a_restart(robot: FirmwareRobot) -> None:
    with driver_for(robot) as driver:
        driver.send_action(Action.FORWARD)
        robot.__exit__()
        with pytest.raises(DriveError, match="not answered"):
            for _ in range(100):
                driver.send_action(Action.FORWARD)
        robot.__enter__()
        send_until(driver, Action.LEFT, robot.is_moving)
