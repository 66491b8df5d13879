"""Robots that answer each order with a report; subclasses supply the transport and the wording."""

from __future__ import annotations

import socket
from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

from robot.bodies.remote.orders import (
    BodyReport,
    Order,
    encode_order,
    moves_option,
    parse_moves,
    parse_report,
    split_address,
)
from robot.bodies.remote.plain import HELLO, encode_plain_order, parse_plain_report
from robot.bodies.remote.same_device import Found, SameDevice
from robot.clock import Clock
from robot.devices.options import Options, option
from robot.devkit.connected_driver import ConnectedDriver
from robot.driver import ACTION_TIMEOUT_S, Sensors
from robot.errors import DriveError, told_as
from robot.types import Action, Point

PORT = 4210
REPLY_S = 0.15
"""Time limit for a report, in seconds. A single lost report does not count as a fault."""
GONE_S = 0.5
"""Time without any report after which the robot counts as gone, in seconds."""
_CONNECT_S = 3.0
_CONNECT_TRIES = 20
"""Minimum number of unanswered requests after which a robot counts as silent. A time limit is not
enough: if this computer pauses, the time may end after only a few requests."""


class MessageLine(Protocol):
    """Messages as bytes. Methods raise OSError when the line fails."""

    def send(self, message: bytes) -> None: ...

    def receive(self, timeout_s: float) -> bytes | None:
        """Return the next message, or None after `timeout_s`."""

    def close(self) -> None:
        """Close the connection; idempotent."""


class ReportingDriver(ConnectedDriver[MessageLine]):
    """Sends orders that end by themselves, and receives the reports that answer them."""

    default_camera: ClassVar[str] = "phone"
    is_remote: ClassVar[bool] = True
    hello: ClassVar[bytes] = HELLO
    no_answer: ClassVar[str]
    no_obedience: ClassVar[str]
    """Advice at the end of an error message. `no_answer` is for a robot that never answered, and
    `no_obedience` for a robot that answers but does not obey."""

    def __init__(self, options: Any, where: str, clock: Clock | None = None) -> None:
        """Store the options. `where` is the robot's name in messages, for example `the hub`."""
        super().__init__(options, clock)
        self._where = where
        self._report: BodyReport | None = None
        self._device = ""
        """The robot's name in its reports; empty if they contain none. Once the name is known, no
        robot with another name is driven."""
        self._is_other = False
        """True if another robot answers at the address. It is asked for reports, but receives no
        orders."""
        self._heard_s = 0.0
        self._disobeyed = 0
        self._seq = 0
        self._trouble = ""

    @abstractmethod
    def _open_line(self) -> MessageLine:
        """Open the connection to the robot; raises OSError."""

    @property
    def device(self) -> str:
        return self._device

    @property
    def takes_points(self) -> bool:  # type: ignore[override]
        """True once the robot has reported that it accepts points."""
        return self._report is not None and self._report.takes_points

    def _encode(self, order: Order, nonce: str) -> bytes:
        """Encode one order. By default, return one line of words without a signature. Orders
        without a signature are only for private connections, on which no other program can send."""
        return encode_plain_order(order)

    def _parse(self, data: bytes) -> BodyReport | None:
        return parse_plain_report(data)

    def _open(self) -> MessageLine:
        self._report, self._disobeyed = None, 0
        with told_as(DriveError, f"cannot reach {self._where}"):
            return self._open_line()

    def _begin(self) -> None:
        end_s, tries = self._clock.now_s() + _CONNECT_S, 0
        while self._report is None and (self._clock.now_s() < end_s or tries < _CONNECT_TRIES):
            self._exchange(self.hello)
            tries += 1
        if self._report is None:
            raise DriveError(f"{self._where} does not answer{self._trouble}; {self.no_answer}")
        self.stop()

    def _close(self, connection: MessageLine) -> None:
        connection.close()

    def _drive(self, action: Action, point: Point | None, speed_scale: float) -> None:
        self._order(action, speed_scale, point)
        self._check_heard()

    def sense(self) -> Sensors:
        """Return the sensor values of the robot's last report. Request a new report if the last
        one is old."""
        if self.is_connected and self._clock.now_s() - self._heard_s > REPLY_S:
            self._exchange(self.hello)
            self._check_heard()
        return self._report.sensors if self._report is not None else Sensors()

    def stop(self) -> None:
        """Stop the robot; if the connection is lost, the robot stops by itself."""
        if self._report is not None and self.is_connected:
            self._order(Action.STOP, 1.0)

    def _order(self, action: Action, speed_scale: float, point: Point | None = None) -> None:
        report = self._report
        if report is None:
            raise DriveError("the robot has not reported yet")
        self._seq = max(self._seq, report.seq) + 1
        heard_s = self._heard_s
        for_ms = round(1000 * ACTION_TIMEOUT_S)
        order = Order(action, for_ms, speed_scale, self._seq, report.ms, point)
        self._exchange(self.hello if self._is_other else self._encode(order, report.nonce))
        # a report about an earlier order does not confirm the newest order
        if self._heard_s > heard_s:
            is_obeyed = self._report is not None and self._report.seq > report.seq
            self._disobeyed = 0 if is_obeyed else self._disobeyed + 1

    def _exchange(self, message: bytes) -> None:
        """Send a message. Wait for a report for at most `REPLY_S`, and store the newest report that
        has arrived. An error of the connection is only stored; `_check_heard` raises it after
        `GONE_S`."""
        line = self._connection
        if line is None:
            return
        try:
            line.send(message)
            data = line.receive(REPLY_S)
            while data is not None:
                self._take(data)
                data = line.receive(0.0)
        except OSError as error:  # also raised if a datagram is refused because no program listens
            self._trouble = f" ({error})" if str(error) else ""
            self._clock.sleep(REPLY_S / 10)

    def _take(self, data: bytes) -> None:
        report = self._parse(data)
        if report is None:
            return
        self._is_other = self._device not in ("", report.device)
        if self._is_other:
            other = repr(report.device) if report.device else "a robot without a name"
            self._trouble = f" ({other} answers there now, not {self._device!r})"
            return
        self._device = report.device
        if self._report is not None and report.nonce != self._report.nonce:
            self._seq = 0  # the robot was restarted, and counts from 0 again
        self._report, self._heard_s, self._trouble = report, self._clock.now_s(), ""

    def _check_heard(self) -> None:
        silent_s = self._clock.now_s() - self._heard_s
        if silent_s > GONE_S:
            raise DriveError(
                f"{self._where} has not answered for {silent_s:.1f} s{self._trouble}; "
                "is it switched on and in range?"
            )
        if self._disobeyed > 3:
            raise DriveError(
                f"{self._where} answers, but does not obey orders; {self.no_obedience}"
            )


def the_only_one(host: str) -> str:
    """Return the IP address of a host whose name ends in `.local`; return other hosts unchanged.

    Several machines may have the same `.local` name, because many small robots keep the name that
    their example program contains.

    Raises:
        DriveError: If several machines answer to the name; the error lists them.
    """
    if not host.lower().endswith(".local"):
        return host
    found = socket.getaddrinfo(host, None, socket.AF_INET, socket.SOCK_DGRAM)
    same = SameDevice("machine", flag="--address")
    with told_as(DriveError, f"it is unclear which robot is {host}", ConnectionError):
        chosen = same.pick(Found("", str(place[0])) for *_, place in found)
    return host if chosen is None else chosen.address


@dataclass(frozen=True, slots=True, kw_only=True)
class RemoteOptions(Options):
    """The robot's address and its moves."""

    address: str = option("", "the robot's HOST, or HOST:PORT")
    secret: str = option("", "secret shared with the robot", secret=True)
    body_moves: str = moves_option("forward,left,right,backward")


class RemoteDriver(ReportingDriver):
    """A robot at an address, driven by the one-page protocol; subclasses supply the transport."""

    line_type: ClassVar[type[Any]]
    """The `MessageLine`, constructed with host and port."""
    options_type: ClassVar[type[Any]] = RemoteOptions
    hello: ClassVar[bytes] = b"{}"
    no_answer: ClassVar[str] = "is it switched on, in the same network, and is this its address?"
    no_obedience: ClassVar[str] = "does it have the same --secret?"

    def __init__(self, options: RemoteOptions, clock: Clock | None = None) -> None:
        super().__init__(options, f"the robot at {options.address}", clock)
        self.declared_moves = parse_moves(options.body_moves)

    def _open_line(self) -> MessageLine:
        host, port = split_address(self.options.address, PORT)
        line: MessageLine = self.line_type(the_only_one(host), port)
        return line

    def _encode(self, order: Order, nonce: str) -> bytes:
        return encode_order(order, nonce, self.options.secret)

    def _parse(self, data: bytes) -> BodyReport | None:
        return parse_report(data)
