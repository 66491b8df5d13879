"""An EV3 with LEGO's original firmware, without a card, over Wi-Fi, Bluetooth or USB."""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from robot.bodies.ev3.driver import ChassisBody, ChassisDriver, ChassisOptions
from robot.bodies.ev3.stock import codec
from robot.bodies.ev3.stock.lines import BEACON_PORT, BrickLine, open_line, shown_id
from robot.clock import Clock
from robot.devices.options import option
from robot.errors import ConfigurationError, DriveError

TOP_DPS = {codec.LARGE_MOTOR: 1050.0, codec.MEDIUM_MOTOR: 1560.0}
"""The speed of each motor at the firmware's 100 percent, in degrees a second."""
_LIGHTS = {"stopped": 1, "train": 3, "autonomous": 2}
_PORTS = {f"out{letter}": place for place, letter in enumerate("ABCD")}
_SENSOR_PORTS = {f"in{place + 1}": place for place in range(4)}


class StockBody:
    """A brick as a `ChassisBody`: two motors, and the sensors that are plugged in.

    A message is sent only after the answer to the previous one, so at most one order is on its way
    when a connection stalls. If that order is delivered late, the robot moves for at most 0.4 s.
    """

    def __init__(self, open_line: Callable[[], BrickLine], ports: Mapping[str, str]) -> None:
        self._open_line = open_line
        self._line: BrickLine | None = None
        self._is_lost = self._is_closed = False
        self._count = 0
        self._motors = [_known(port, _PORTS) for port in (ports["left"], ports["right"])]
        self._wanted = {codec.ULTRASONIC: ports["ultrasonic"], codec.TOUCH: ports["touch"]}
        self._top_dps = [0.0, 0.0]
        self._ultrasonic: list[int] = []
        self._touches: list[int] = []

    @property
    def _both(self) -> int:
        return sum(1 << port for port in self._motors)

    def open(self) -> Sequence[float]:
        """Connect, stop motors that another program left running, and find motors and sensors."""
        self._is_lost = self._is_closed = False
        self._line = self._open_line()
        if self._is_closed:  # another thread closed the driver meanwhile
            self.close()
        self._ask(codec.stop(self._both) + codec.reset(self._both))
        ports = [*range(4), *(codec.OUTPUTS + port for port in self._motors)]
        asked = b"".join(codec.device_type(port, 2 * at) for at, port in enumerate(ports))
        kinds = self._ask(asked, 2 * len(ports))[::2]
        for place, (port, kind) in enumerate(zip(self._motors, kinds[4:], strict=True)):
            if kind not in TOP_DPS:
                raise DriveError(f"no motor answers at port out{'ABCD'[port]}; check its cable")
            self._top_dps[place] = TOP_DPS[kind]
        self._ultrasonic = self._choose(codec.ULTRASONIC, kinds)[:1]
        self._touches = self._choose(codec.TOUCH, kinds)
        return self._top_dps

    def _choose(self, kind: int, kinds: bytes) -> list[int]:
        wanted = self._wanted[kind]
        if wanted == "none":
            return []
        if wanted == "auto":
            return [port for port in range(4) if kinds[port] == kind]
        ports = [_known(name.strip(), _SENSOR_PORTS) for name in wanted.split(",")]
        for port in ports:
            if kinds[port] != kind:
                name = "ultrasonic" if kind == codec.ULTRASONIC else "touch"
                raise DriveError(f"no {name} sensor answers at port in{port + 1}; check its cable")
        return ports

    def run(self, left_dps: float, right_dps: float, time_ms: int) -> None:
        """Turn the wheels for at most `time_ms`; a wheel with speed 0 is stopped."""
        codes = b""
        for port, dps, top in zip(self._motors, (left_dps, right_dps), self._top_dps, strict=True):
            percent = max(-100, min(100, round(100 * dps / top)))
            if percent == 0 and dps:
                percent = 1 if dps > 0 else -1
            codes += (
                codec.timed_speed(1 << port, percent, time_ms) if percent else codec.stop(1 << port)
            )
        self._ask(codes)

    def stop(self) -> None:
        """Stop the motors; if the connection is lost, the firmware ends the move."""
        with contextlib.suppress(DriveError):
            self._ask(codec.stop(self._both))

    def positions(self) -> list[float]:
        asked = b"".join(codec.motor_count(p, 4 * at) for at, p in enumerate(self._motors))
        return [float(count) for count in struct.unpack("<2i", self._ask(asked, 8))]

    def sense(self) -> dict[str, Any]:
        """Read distance, bumpers and battery in one question; first reconnect if needed."""
        if self._is_lost:
            self.open()
        sensors = [(port, codec.ULTRASONIC) for port in self._ultrasonic]
        sensors += [(port, codec.TOUCH) for port in self._touches]
        asked = b"".join(
            codec.sensor(port, kind, 4 * at) for at, (port, kind) in enumerate(sensors)
        )
        size = 4 * len(sensors)
        data = self._ask(asked + codec.battery(size), size + 1)
        values = list(struct.unpack_from(f"<{len(sensors)}f", data))
        distance_m = values.pop(0) / 100 if self._ultrasonic else None
        bumpers = tuple(value > 0.5 for value in values)
        return {
            "distance_m": distance_m if distance_m is None or 0 <= distance_m <= 2.55 else None,
            "bumped": any(bumpers) if bumpers else None,
            "bumpers": bumpers,
            "battery_share": min(100, data[size]) / 100,
        }

    def take_button(self) -> str | None:
        """Return None, because the buttons belong to the firmware's own menu."""
        return None

    def show(self, mode: str, address: str) -> None:
        with contextlib.suppress(DriveError):
            self._ask(codec.light(_LIGHTS.get(mode, 1)))

    def close(self) -> None:
        self.stop()
        self._is_closed = True
        line, self._line = self._line, None
        if line is not None:
            line.close()

    def _ask(self, codes: bytes, results: int = 0) -> bytes:
        if self._line is None:
            raise DriveError("the brick is not connected")
        self._count = self._count % 0xFFFF + 1
        try:
            reply = self._line.ask(codec.command(self._count, codes, results))
            return codec.parse_answer(reply, self._count, results)
        except DriveError:
            self._is_lost = True
            self._line.close()
            raise


def _known(name: str, ports: dict[str, int]) -> int:
    if name not in ports:
        raise ConfigurationError(f"unknown port {name!r}; choose one of: {', '.join(ports)}")
    return ports[name]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ev3StockOptions(ChassisOptions):
    """The robot's dimensions, and its brick's connection."""

    line: str = option("usb", "connection to the brick", choices=("usb", "bluetooth", "wifi"))
    brick: str = option(
        "",
        "ID of the brick, such as 00:16:53:3f:0c:1e; needed for Bluetooth or with several bricks",
    )
    beacon_port: int = option(
        BEACON_PORT, "UDP port at which bricks on Wi-Fi announce themselves", range=(1, 65535)
    )


class Ev3StockDriver(ChassisDriver):
    """A Lego Mindstorms EV3 with LEGO's own firmware; each move is timed by the brick."""

    name: ClassVar[str] = "ev3-stock"
    default_camera: ClassVar[str] = "phone"
    options_type: ClassVar[type[Any]] = Ev3StockOptions
    is_remote: ClassVar[bool] = True
    options: Ev3StockOptions

    def __init__(self, options: Ev3StockOptions, clock: Clock | None = None) -> None:
        super().__init__(options, clock)
        self._serial = options.brick
        """The brick's serial number. After a lost connection, no other brick is driven."""

    @property
    def device(self) -> str:
        return shown_id(self._serial)

    def _open(self) -> ChassisBody:
        return StockBody(self._open_line, self.options.ports())

    def _open_line(self) -> BrickLine:
        line = open_line(self.options.line, self._serial, self.options.beacon_port, self._clock)
        self._serial = self._serial or line.serial
        return line
