"""Connections to a brick with LEGO's firmware: Wi-Fi, Bluetooth and USB.

The brick answers each message, and the next message is sent only after the answer.
"""

from __future__ import annotations

import contextlib
import os
import re
import select
import socket
import struct
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from io import FileIO
from pathlib import Path
from typing import ClassVar, NamedTuple

from robot.bodies.ev3.stock.codec import MAX_MESSAGE
from robot.bodies.remote.same_device import Found, SameDevice
from robot.clock import Clock, RealClock
from robot.errors import DriveError, told_as

BEACON_PORT = 3015
ANSWER_S = 0.4
"""Timeout of an answer, in s. An answer takes a few ms by cable and Wi-Fi, and up to 50 ms by
Bluetooth."""
_BEACON_S, _LISTEN_S = 8.0, 0.5
TWINS_S = 5.5
"""Time for which announcements are collected if no brick was named, in s. Each brick announces
itself every 5 s."""
_AGAIN_S = 1.0
"""Announcements of a brick that arrive within this time, in seconds, count as one, because a
computer may receive the same announcement over two networks."""
_CONNECT_S = 4.0
_USB_ID = "0003:00000694:00000005"
_ID = re.compile("[0-9a-f]{12}")
_HIDRAW = Path("/sys/class/hidraw")


class BrickLine(ABC):
    """A connection to one brick. After a missed answer the connection is closed and has to be
    opened again, because a late answer would be taken for the answer to the next question."""

    _remedy: ClassVar[str]
    _device: socket.socket | FileIO

    def __init__(self, name: str, device: socket.socket | FileIO, serial: str = "") -> None:
        self._name, self._device = name, device
        self.serial = serial
        """The brick's serial number; empty if unknown."""

    def ask(self, message: bytes) -> bytes:
        """Send a message and return the answer; raises DriveError if there is no answer."""
        try:
            return self._exchange(message)
        except (OSError, ValueError, struct.error) as error:
            self.close()
            raise DriveError(
                f"no valid answer from the brick ({self._name}: {error}); {self._remedy}"
            ) from error

    def close(self) -> None:
        """Close the connection; idempotent."""
        self._device.close()

    @abstractmethod
    def _exchange(self, message: bytes) -> bytes: ...


class SocketLine(BrickLine):
    """Sends and receives messages over a socket (Wi-Fi or Bluetooth). Each message begins with its
    length."""

    _remedy = "is it switched on and in range?"
    _device: socket.socket

    def _exchange(self, message: bytes) -> bytes:
        self._device.settimeout(ANSWER_S)
        self._device.sendall(message)
        head = self._read(2)
        return head + self._read(struct.unpack("<H", head)[0])

    def _read(self, count: int) -> bytes:
        if count > MAX_MESSAGE:
            raise ValueError("the brick sent a reply that is too long")
        data = b""
        while len(data) < count:
            part = self._device.recv(count - len(data))
            if not part:
                raise ConnectionError("it closed the connection")
            data += part
        return data


class UsbLine(BrickLine):
    """A connection by USB cable, which Linux shows as a HID device with reports of 1024 bytes."""

    _remedy = "is its cable plugged in?"
    _device: FileIO

    def _exchange(self, message: bytes) -> bytes:
        self._device.write(b"\0" + message.ljust(MAX_MESSAGE, b"\0"))
        if not select.select([self._device], [], [], ANSWER_S)[0]:
            raise TimeoutError("timed out")
        report = self._device.read(MAX_MESSAGE) or b""
        return report[: 2 + int(struct.unpack_from("<H", report)[0])]


def open_line(
    kind: str, brick: str = "", beacon_port: int = BEACON_PORT, clock: Clock | None = None
) -> BrickLine:
    """Open a connection to a brick.

    Args:
        kind: `wifi`, `bluetooth` or `usb`.
        brick: The serial number, which is the Bluetooth address, to choose among several bricks.
        beacon_port: The port at which bricks on Wi-Fi announce themselves.
        clock: The clock by which the wait for announcements is timed.

    Raises:
        DriveError: If there is no brick; the error says what to check.
    """
    wanted = _plain_id(brick)
    if kind == "wifi":
        return _open_wifi(wanted, beacon_port, clock or RealClock())
    if kind == "bluetooth":
        return _open_bluetooth(wanted)
    path = find_usb(wanted)
    line = _open_usb(path)
    line.serial = next((one for one, at in _usb_bricks().items() if at == path), wanted)
    return line


def _open_wifi(wanted: str, beacon_port: int, clock: Clock) -> BrickLine:
    host, _, serial, port = _receive_beacon(wanted, beacon_port, clock)
    wrong = f"the brick at {host} cannot be reached"
    with (
        told_as(DriveError, wrong),
        _begun(socket.create_connection((host, port), _CONNECT_S)) as sock,
    ):
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        sock.sendall(f"GET /target?sn={serial} VMTP1.0\r\nProtocol: EV3\r\n\r\n".encode())
        if not sock.recv(64).startswith(b"Accept:EV340"):
            raise DriveError(
                f"the device at {host}:{port} is not an EV3, or it is already connected to "
                "another program"
            )
    return SocketLine(f"Wi-Fi, {host}", sock, serial)


@contextlib.contextmanager
def _begun(sock: socket.socket) -> Iterator[socket.socket]:
    """Close a connection that fails to open, because otherwise it would block the next one."""
    try:
        yield sock
    except BaseException:
        sock.close()
        raise


class Beacon(NamedTuple):
    """One announcement of a brick: its sender and its content."""

    host: str
    sender_port: int
    serial: str
    port: int


def _receive_beacon(wanted: str, beacon_port: int, clock: Clock) -> Beacon:
    """Wait for the brick's announcement and answer it, because the brick accepts connections only
    after the answer."""
    wrong = "cannot listen for bricks on Wi-Fi"
    do = "is another program, such as LEGO's, using that port?"
    with (
        told_as(DriveError, f"{wrong} at UDP port {beacon_port}", do=do),
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock,
    ):
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        sock.bind(("", beacon_port))
        beacon = choose_brick(_beacons(sock, clock), wanted)
        if beacon is not None:
            # Answer to the sender's port and, as other clients do, to the port in the announcement.
            sock.sendto(b"\0", (beacon.host, beacon.sender_port))
            sock.sendto(b"\0", (beacon.host, beacon.port))
            return beacon
    which = f"the brick {shown_id(wanted)}" if wanted else "no brick"
    raise DriveError(
        f"{which} was not found on Wi-Fi within {_BEACON_S:g} s; is its Wi-Fi on, and is "
        f"this computer in the same network (UDP port {beacon_port})?"
    )


def _beacons(sock: socket.socket, clock: Clock) -> Iterator[tuple[float, Beacon | None]]:
    """Yield announcements with their times; None in place of an announcement if none arrives."""
    end_s = clock.now_s() + _BEACON_S
    sock.settimeout(_LISTEN_S)
    while clock.now_s() < end_s:
        found = None
        with contextlib.suppress(TimeoutError):
            data, sender = sock.recvfrom(1024)
            found = parse_beacon(data)
        now_s = clock.now_s()
        yield now_s, None if found is None else Beacon(sender[0], sender[1], *found)


def choose_brick(heard: Iterable[tuple[float, Beacon | None]], wanted: str = "") -> Beacon | None:
    """Return the wanted brick, or the only brick if none was named. Return None if no such brick
    announces itself.

    If no brick was named, a brick is chosen only after all bricks have been heard. All bricks
    announce themselves at the same interval, so all have been heard when the first one announces
    itself again, and the search ends.

    Args:
        heard: Announcements with their times, in seconds. A computer with two connections to the
            network receives each announcement twice.
        wanted: The wanted serial number.

    Raises:
        DriveError: If several bricks match; the error lists them.
    """
    bricks: dict[str, Beacon] = {}
    since_s = 0.0
    for now_s, beacon in heard:
        if beacon is not None and wanted:
            if beacon.serial == wanted:
                return beacon
            continue
        since_s = since_s if bricks else now_s
        is_again = beacon is not None and beacon.serial == next(iter(bricks), "")
        if beacon is not None:
            bricks[beacon.serial] = beacon
        if bricks and now_s - since_s > (_AGAIN_S if is_again else TWINS_S):
            break
    same = SameDevice("brick", flag="--brick")
    with told_as(DriveError, "it is unclear which brick to drive", ConnectionError):
        chosen = same.pick(Found("", shown_id(serial)) for serial in bricks)
    return None if chosen is None else bricks[_plain_id(chosen.address)]


def parse_beacon(data: bytes) -> tuple[str, int] | None:
    """Return serial number and port of an announcement; None if it is not from an EV3."""
    text = data.decode("ascii", "replace")
    serial = re.search(r"Serial-Number:\s*([0-9A-Fa-f]{12})", text)
    port = re.search(r"Port:\s*(\d{1,5})\b", text)
    if serial is None or port is None or "EV3" not in text or not 0 < int(port[1]) < 65536:
        return None
    return serial[1].lower(), int(port[1])


def _open_bluetooth(wanted: str) -> BrickLine:
    if _ID.fullmatch(wanted) is None:
        raise DriveError(
            "Bluetooth needs the brick's address, such as --brick 00:16:53:3f:0c:1e; the brick "
            "shows it under Settings, Brick Info, ID"
        )
    address = shown_id(wanted).upper()
    if not hasattr(socket, "AF_BLUETOOTH"):
        raise DriveError("this Python has no Bluetooth; use --line wifi or --line usb")
    wrong = f"the brick {address} cannot be reached by Bluetooth"
    kind = socket.AF_BLUETOOTH, socket.SOCK_STREAM, socket.BTPROTO_RFCOMM
    with (
        told_as(DriveError, wrong, do="is it paired and on?"),
        _begun(socket.socket(*kind)) as sock,
    ):
        sock.settimeout(_CONNECT_S)
        sock.connect((address, 1))
    return SocketLine(f"Bluetooth, {address}", sock, wanted)


def _open_usb(path: Path) -> BrickLine:
    do = "docs/howto/ev3-stock.md explains how to allow it"
    with told_as(DriveError, f"the brick at {path} cannot be opened", do=do):
        return UsbLine(str(path), FileIO(os.open(path, os.O_RDWR | os.O_NONBLOCK), "r+"))


def find_usb(wanted: str = "", root: Path | None = None) -> Path:
    """Return the USB device of the wanted brick, or of the only brick if none was named.

    Raises:
        DriveError: If the brick is missing or several bricks match; the error lists the bricks
            found.
    """
    bricks = _usb_bricks(root)
    if not bricks:
        raise DriveError(
            "no EV3 with LEGO's firmware is connected by USB; is it switched on? (--line usb works "
            "on Linux; elsewhere use --line wifi)"
        )
    if wanted not in bricks and (wanted or len(bricks) > 1):
        there = [shown_id(one) for one in bricks]
        raise DriveError(
            (
                f"the brick {shown_id(wanted)} is not connected by USB"
                if wanted
                else "it is unclear which brick to drive"
            )
            + f"; connected by USB: {', '.join(there)}; choose yours with --brick {there[0]}"
        )
    return bricks.get(wanted) or next(iter(bricks.values()))


def _usb_bricks(root: Path | None = None) -> dict[str, Path]:
    """Return the bricks that are connected by USB. The keys are serial numbers, or USB sockets for
    bricks without a known serial number."""
    bricks: dict[str, Path] = {}
    for entry in sorted((root or _HIDRAW).glob("hidraw*")):
        with contextlib.suppress(OSError):
            told = (entry / "device/uevent").read_text()
            if _USB_ID in told:
                serial = re.search(r"^HID_UNIQ=(\S+)", told, re.MULTILINE)
                socket_of = re.search(r"^HID_PHYS=(\S+)", told, re.MULTILINE)
                known = serial or socket_of
                bricks[_plain_id(known[1]) if known else entry.name] = Path("/dev") / entry.name
    return bricks


def _plain_id(brick: str) -> str:
    return brick.replace(":", "").lower()


def shown_id(brick: str) -> str:
    """Return an ID in pairs of digits, as the brick shows it."""
    return ":".join(re.findall("..", brick)) if _ID.fullmatch(brick) else brick
