"""Our codec and connections for LEGO's firmware, with a simulated brick."""

from __future__ import annotations

import io
import json
import os
import socket
import struct
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.bodies.ev3.stock import codec, lines
from robot.bodies.ev3.stock.lines import BEACON_PORT, UsbLine, find_usb, open_line, parse_beacon
from robot.bodies.ev3.stock_driver import Ev3StockDriver, Ev3StockOptions, StockBody
from robot.errors import ConfigurationError, DriveError
from robot.testing import VirtualClock
from robot.types import Action
from tests.contract.real_parts import check_real_driver
from tests.kit.needed import installed
from tests.kit.run import run
from tests.standins.ev3_stock import SERIAL, TOUCH, StockBrick, StockFirmware, _Machine


@given(st.integers(-(2**31) + 1, 2**31 - 1))
def test_numbers_are_encoded_in_as_few_bytes_as_possible(value: int) -> None:
    code = codec.number(value)
    assert _Machine(StockFirmware(), code, bytearray()).parameter() == value
    bits = abs(value)
    is_short = -32 <= value < 32
    assert len(code) == (1 if is_short else 2) + (bits > 127) + 2 * (bits > 32767)


@given(st.binary(max_size=40))
def test_an_invalid_answer_is_refused(message: bytes) -> None:
    asked = int.from_bytes(message[2:4], "little")
    try:
        data = codec.parse_answer(message, asked)
    except DriveError:
        return
    assert struct.unpack_from("<H", message)[0] + 2 == len(message) == 5 + len(data)
    for other, results in ((asked + 1, 0), (asked, len(data) + 1)):
        with pytest.raises(DriveError, match="another command"):
            codec.parse_answer(message, other, results)


def test_a_command_that_is_too_long_is_refused() -> None:
    with pytest.raises(ValueError, match="1024"):
        codec.command(1, bytes(1024))
    with pytest.raises(ValueError, match="32 bits"):
        codec.number(2**31)


def test_only_an_ev3s_beacon_counts() -> None:
    beacon = b"Serial-Number: 0016533F0C1E\r\nPort: 5555\r\nName: EV3\r\nProtocol: EV3\r\n"
    assert parse_beacon(beacon) == ("0016533f0c1e", 5555)
    for part, other in ((b"5555", b"99999"), (b"16533F0C1E", b""), (b"EV3", b"NXT")):
        assert parse_beacon(beacon.replace(part, other)) is None, other
    assert parse_beacon(b"\xff\xfe") is None


@pytest.fixture
def brick() -> StockFirmware:
    return StockFirmware(VirtualClock().now_s)


def driver_for(brick: StockFirmware, **options: str) -> Ev3StockDriver:
    """Return a driver whose commands reach the firmware without a socket."""

    def ask(message: bytes) -> bytes:
        brick.messages.append(message)
        return brick.answer(message) or b""

    driver = Ev3StockDriver(Ev3StockOptions(**options))
    line = SimpleNamespace(ask=ask, close=lambda: None)
    driver._open = lambda: StockBody(lambda: line, driver.options.ports())
    return driver


def test_moves_turn_the_right_wheels_and_carry_their_time(brick: StockFirmware) -> None:
    wheels = {
        Action.FORWARD: (34, 34),
        Action.BACKWARD: (-34, -34),
        Action.LEFT: (-9, 0),
        Action.RIGHT: (0, -9),
        Action.SPIN_LEFT: (-4, 4),
        Action.SPIN_RIGHT: (4, -4),
    }
    brick.motors[1].polarity = -1  # another program has left this setting and a turning motor
    brick.motors[2].percent, brick.motors[2].ends_s = 50, float("inf")
    with driver_for(brick) as driver:
        assert not brick.is_moving and brick.motors[1].polarity == 1
        assert [motor.resets for motor in brick.motors] == [0, 1, 1, 0]
        assert driver.rolled_m() == (0.0, 0.0)
        for action, (left, right) in wheels.items():
            driver.send_action(action)
            assert (brick.motors[1].percent, brick.motors[2].percent) == (left, right), action
            assert codec.number(400) in brick.messages[-1]
        driver.send_action(Action.FORWARD, speed_scale=0.01)
        assert brick.motors[1].percent == 1, "a slow wheel still turns"
    brick.devices[0x11] = 8
    with driver_for(brick) as driver:
        driver.send_action(Action.FORWARD)
        assert brick.motors[1].percent == 23, "a medium motor gets less power"


def test_sensors_are_found_and_read(brick: StockFirmware) -> None:
    brick.devices[1] = TOUCH
    brick.values[TOUCH] = 1.0
    with driver_for(brick) as driver:
        sensors = driver.sense()
        assert sensors.distance_m == pytest.approx(0.42) and sensors.battery_share == 0.8
        assert sensors.bumpers == (True, True) and sensors.bumped
        brick.values[TOUCH], brick.values[30] = 0.0, 255.1
        assert driver.sense().distance_m is None and not driver.sense().bumped
    with driver_for(brick, touch_port="in2", ultrasonic_port="none") as driver:
        assert driver.sense().bumpers == (False,) and driver.sense().distance_m is None


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"left_port": "outA"}, "outA"),
        ({"left_port": "left"}, "outA, outB"),
        ({"ultrasonic_port": "in2"}, "in2"),
        ({"touch_port": "in1,in3"}, "in3"),
    ],
)
def test_motors_and_sensors_that_are_not_plugged_in_are_named(
    brick: StockFirmware, options: dict[str, str], said: str
) -> None:
    with pytest.raises((DriveError, ConfigurationError), match=said):
        driver_for(brick, **options).connect()


@pytest.mark.realtime
def test_a_brick_on_a_real_connection_is_found_again_after_a_loss() -> None:
    with StockBrick() as brick:
        options = Ev3StockOptions(line="wifi", brick=SERIAL, beacon_port=brick.beacon_port)
        driver = Ev3StockDriver(options)
        check_real_driver(driver, lambda: brick.is_moving)
        with driver:
            brick.frozen.set()
            with pytest.raises(DriveError, match="no valid answer from the brick"):
                driver.send_action(Action.FORWARD)
            with pytest.raises(DriveError):
                driver.send_action(Action.FORWARD)
            brick.frozen.clear()
            driver.sense()
            driver.send_action(Action.FORWARD)
            assert brick.is_moving


@pytest.mark.realtime
def test_a_foreign_client_drives_the_stand_in_and_sends_what_we_send() -> None:
    """`ev3-dc` is GPLv3 and not a dependency: CI installs it only for this test."""
    client = Path(__file__).with_name("foreign_client.py")
    env = {**os.environ, "PYTHONPATH": str(installed("ev3-dc", "ev3_dc"))}
    with StockBrick(BEACON_PORT) as brick:
        done = run(sys.executable, client, "00:16:53:3F:0C:1E", env=env)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    for value, code in told["numbers"].items():
        assert codec.number(int(value)).hex() == code, value
    for index, code in told["results"].items():
        assert codec.result(int(index)).hex() == code, index
    assert told["read"] == [0.0, 42.0, 80]
    sensors = codec.sensor(0, codec.TOUCH, 0) + codec.sensor(3, codec.ULTRASONIC, 4)
    asked = [sensors + codec.battery(8), codec.timed_speed(6, 34, 450), codec.stop(6)]
    assert [message[7:] for message in brick.messages][-3:] == asked
    assert [motor.ends_s > 0 for motor in brick.motors] == [False, True, True, False]
    assert not brick.is_moving


@pytest.mark.parametrize("line", ["wifi", "bluetooth"])
def test_a_connection_that_fails_while_it_is_opened_is_closed_at_once(
    monkeypatch: pytest.MonkeyPatch, line: str
) -> None:
    """A brick serves one connection, so an error that is kept must not keep its connection open."""
    made: list[socket.socket] = []

    class Mute(socket.socket):
        def __init__(self, *_: object) -> None:
            super().__init__(socket.AF_INET, socket.SOCK_STREAM)
            made.append(self)

        def answer_not(self, *_: object) -> None:
            raise TimeoutError("timed out")

        connect = sendall = answer_not

    monkeypatch.setattr(lines, "_receive_beacon", lambda *_: ("127.0.0.1", 3015, SERIAL, 1))
    monkeypatch.setattr(socket, "create_connection", Mute)
    monkeypatch.setattr(socket, "socket", Mute)
    for name in ("AF_BLUETOOTH", "BTPROTO_RFCOMM"):
        monkeypatch.setattr(socket, name, 0, raising=False)
    with pytest.raises(DriveError, match="cannot be reached") as kept:
        open_line(line, SERIAL)
    assert [one.fileno() for one in made] == [-1], kept


def test_a_missing_address_and_a_port_that_another_program_has_are_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for brick_id in ("", "00:16", "xyz"):
        with pytest.raises(DriveError, match="--brick"):
            open_line("bluetooth", brick_id)

    class Taken(socket.socket):
        def bind(self, address: object) -> None:
            raise OSError(98, "Address already in use")

    monkeypatch.setattr(socket, "socket", Taken)
    with pytest.raises(DriveError, match=r"UDP port 3015: Address already in use; .*another prog"):
        open_line("wifi", SERIAL)


def test_bricks_on_usb_are_looked_for_where_linux_lists_them(tmp_path: Path) -> None:
    def plug_in(number: int, usb_id: str, serial: str) -> None:
        device = tmp_path / f"hidraw{number}" / "device"
        device.mkdir(parents=True, exist_ok=True)
        (device / "uevent").write_text(f"HID_ID={usb_id}\nHID_NAME=LEGO EV3\nHID_UNIQ={serial}\n")

    ev3 = "0003:00000694:00000005"
    with pytest.raises(DriveError, match="switched on"):
        find_usb(root=tmp_path)
    plug_in(1, "0003:0000046D:0000C52B", "0016533f0c1f")
    plug_in(3, ev3, SERIAL)
    assert find_usb(root=tmp_path) == find_usb(SERIAL, tmp_path) == Path("/dev/hidraw3")
    for other in ("001653000000", "0016533f0c1f", "00", "e"):
        with pytest.raises(DriveError, match=r"not connected by USB.* 00:16:53:3f:0c:1e"):
            find_usb(other, tmp_path)
    for serials in (("0016533F0C1E", "00:16:53:00:00:02"), ("", "")):
        for number, serial in zip((3, 4), serials, strict=True):
            plug_in(number, ev3, serial)
        with pytest.raises(DriveError, match="which brick") as said:
            find_usb(root=tmp_path)
        named = str(said.value).partition("by USB: ")[2].partition(";")[0].split(", ")
        assert len(named) == 2 and f"--brick {named[0]}" in str(said.value)
        for number, name in zip((3, 4), named, strict=True):
            assert find_usb(name.replace(":", ""), tmp_path) == Path(f"/dev/hidraw{number}")


def test_the_cable_carries_reports_of_1024_bytes() -> None:
    """A pseudo-device in place of the cable; its socket pair keeps each report whole, like HID."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    brick = StockFirmware()
    reports: list[bytes] = []

    def play() -> None:
        while report := theirs.recv(2048):
            reports.append(report)
            size = struct.unpack_from("<H", report, 1)[0] + 2
            answer = brick.answer(report[1 : 1 + size])
            theirs.send((answer or b"").ljust(1024, b"\0"))

    thread = threading.Thread(target=play)
    thread.start()
    line = UsbLine("cable", io.FileIO(os.dup(ours.fileno()), "r+"))
    ours.close()
    body = StockBody(lambda: line, Ev3StockOptions().ports())
    body.open()
    body.run(360.0, 360.0, 400)
    assert brick.is_moving and body.sense()["distance_m"] == pytest.approx(0.42)
    body.close()
    thread.join()
    theirs.close()
    assert {len(report) for report in reports} == {1025} and not brick.is_moving
