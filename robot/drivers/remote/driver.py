"""A robot that uses the one-page protocol; subclasses provide the transport."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar

from robot.clock import Clock, RealClock
from robot.driver import ACTION_TIMEOUT_S, Driver
from robot.drivers.remote.line import MessageLine, split_address
from robot.drivers.remote.orders import BodyReport, encode_order, parse_moves, parse_report
from robot.errors import DriveError, NotConnectedError
from robot.types import Action, Sensors

PORT = 4210
REPLY_S = 0.15
"""How long a report is waited for; one that is lost is no fault yet."""
GONE_S = 0.5
"""After so long without any report the robot counts as gone."""
_HELLO = b"{}"
_CONNECT_S = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RemoteOptions:
    """Where the robot is, and what it can do."""

    address: str = field(default="", metadata={"help": "the robot's HOST, or HOST:PORT"})
    secret: str = field(default="", metadata={"help": "secret that the robot knows, too"})
    body_moves: str = field(
        default="forward,left,right,backward",
        metadata={"help": "what the body can do, as forward,left or fast:0:1 (steering:throttle)"},
    )


class RemoteDriver(Driver):
    """Sends signed orders that end by themselves, and takes the reports that answer them."""

    default_camera: ClassVar[str] = "phone"
    options_type: ClassVar[type[Any]] = RemoteOptions
    is_remote: ClassVar[bool] = True

    def __init__(self, options: RemoteOptions, clock: Clock | None = None) -> None:
        self.options = options
        self.declared_moves = parse_moves(options.body_moves)
        self._clock = clock or RealClock()
        self._line: MessageLine | None = None
        self._report: BodyReport | None = None
        self._heard_s = 0.0
        self._disobeyed = 0
        self._seq = 0

    @abstractmethod
    def _open(self, host: str, port: int) -> MessageLine:
        """Open the line; raises OSError."""

    @property
    def is_connected(self) -> bool:
        """True between `connect` and `disconnect`."""
        return self._line is not None

    def connect(self) -> None:
        """Find the robot, and stop it."""
        if self._line is not None:
            return
        host, port = split_address(self.options.address, PORT)
        try:
            line = self._open(host, port)
        except OSError as error:
            raise DriveError(f"no robot can be reached at {host}:{port}: {error}") from error
        self._line, self._report, self._disobeyed = line, None, 0
        end_s = self._clock.now_s() + _CONNECT_S
        while self._report is None and self._clock.now_s() < end_s:
            self._exchange(_HELLO)
        if self._report is None:
            self.disconnect()
            raise DriveError(
                f"nothing at {host}:{port} answers as a robot does; is it on, in the same network, "
                "and is this its address?"
            )
        self.stop()

    def disconnect(self) -> None:
        """Stop the robot, and close the line."""
        self.stop()
        line, self._line = self._line, None
        if line is not None:
            line.close()

    def send_action(self, action: Action, *, speed_scale: float = 1.0) -> Action:
        """Send an order that ends by itself; see `Driver`."""
        self.check_action(action, speed_scale)
        if self._line is None:
            raise NotConnectedError(f"the robot {self.name!r} is not connected; call connect()")
        self._order(action, speed_scale)
        self._check_heard()
        return action

    def sense(self) -> Sensors:
        """Return what the robot last reported; asks it where nothing was sent of late."""
        if self._line is not None and self._clock.now_s() - self._heard_s > REPLY_S:
            self._exchange(_HELLO)
            self._check_heard()
        return self._report.sensors if self._report is not None else Sensors()

    def stop(self) -> None:
        """Have the robot stand; it does so by itself where the line is lost."""
        if self._report is not None and self._line is not None:
            self._order(Action.STOP, 1.0)

    def _order(self, action: Action, speed_scale: float) -> None:
        report = self._report
        if report is None:
            raise DriveError("the robot has not reported yet")
        self._seq = max(self._seq, report.seq) + 1
        heard_s = self._heard_s
        self._exchange(
            encode_order(
                action,
                for_ms=round(1000 * ACTION_TIMEOUT_S),
                speed=speed_scale,
                seq=self._seq,
                report=report,
                secret=self.options.secret,
            )
        )
        if self._heard_s > heard_s:
            is_obeyed = self._report is not None and self._report.seq >= self._seq
            self._disobeyed = 0 if is_obeyed else self._disobeyed + 1

    def _exchange(self, message: bytes) -> None:
        """Send, and take the newest report that comes in time; a failing line is reported later."""
        line = self._line
        if line is None:
            return
        try:
            line.send(message)
            data = line.receive(REPLY_S)
            while data is not None:
                self._take(data)
                data = line.receive(0.0)
        except OSError:  # also a refused datagram: nobody listens there
            self._clock.sleep(REPLY_S / 10)

    def _take(self, data: bytes) -> None:
        report = parse_report(data)
        if report is None:
            return
        if self._report is not None and report.nonce != self._report.nonce:
            self._seq = 0  # it was switched off and on
        self._report, self._heard_s = report, self._clock.now_s()

    def _check_heard(self) -> None:
        silent_s = self._clock.now_s() - self._heard_s
        if silent_s > GONE_S:
            raise DriveError(
                f"the robot at {self.options.address} has not answered for {silent_s:.1f} s; "
                "is it on and in reach?"
            )
        if self._disobeyed > 3:
            raise DriveError(
                f"the robot at {self.options.address} answers but obeys no order; is --secret the "
                "one that it knows?"
            )
