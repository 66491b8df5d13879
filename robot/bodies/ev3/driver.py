"""Converts actions to wheel speeds for every kind of connection to a brick, and drives the brick.

The driver `ev3` is for a brick that runs this program itself; it uses python-ev3dev2.
"""

from __future__ import annotations

import importlib.util
import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar, Protocol

from robot.bodies.ev3.agent.body import BrickBody
from robot.clock import Clock
from robot.devices.options import Options, option
from robot.devkit.connected_driver import ConnectedDriver
from robot.devkit.dead_reckoning import DeadReckoning
from robot.devkit.wheels import CLASSIC_POINTS, Pair, TwoWheels
from robot.driver import ACTION_TIMEOUT_S, BodyButton, Sensors
from robot.errors import ConfigurationError, MissingExtraError
from robot.moves import CLASSIC
from robot.types import Action, Mode, Point


@dataclass(frozen=True, slots=True, kw_only=True)
class ChassisOptions(Options):
    """The robot's dimensions and speeds. The defaults are those of the paper's robot. Both wheels
    turn at 360 degrees a second to drive forward, which is 16 cm/s. To turn, one wheel turns
    backward at 90 degrees a second."""

    left_port: str = option("outB", "port of the left motor")
    right_port: str = option("outC", "port of the right motor")
    ultrasonic_port: str = option(
        "auto", "port of the ultrasonic sensor; auto: search for the sensor; none: do not use it"
    )
    touch_port: str = option(
        "auto",
        "ports of the bumpers (touch sensors) from left to right, such as in4,in1; auto: all that "
        "are plugged in, in the order of their ports; none: no bumpers",
    )
    wheel_diameter_m: float = option(
        0.0509,
        "wheel diameter in metres, which `drivelesson calibrate` measures",
        range=(0.005, 1.0),
    )
    track_m: float = option(0.124, "distance between the wheels in metres", range=(0.01, 2.0))
    forward_speed_mps: float = option(
        0.16, "speed straight ahead in metres a second", range=(0.005, 5.0)
    )
    turn_rate_deg_s: float = option(18.5, "turning rate in degrees a second", range=(0.5, 720.0))
    turn_by: str = option(
        "backward",
        "the wheels that turn the robot: one backward (as in the paper), one forward, or both",
        choices=("backward", "forward", "both"),
    )
    reversed_motors: bool = option(False, "true if both motors are mounted in reverse")

    def check(self) -> None:
        if self.left_port == self.right_port:
            raise ConfigurationError(
                f"--left-port and --right-port are both {self.left_port}; each motor needs its own "
                "port"
            )

    @property
    def degrees_per_m(self) -> float:
        """The angle by which a motor turns while the robot drives a metre ahead, in degrees."""
        return (-360 if self.reversed_motors else 360) / (math.pi * self.wheel_diameter_m)

    def ports(self) -> dict[str, str]:
        """Return the ports of motors and sensors, for `BrickBody` and similar bodies."""
        return {
            "left": self.left_port,
            "right": self.right_port,
            "ultrasonic": self.ultrasonic_port,
            "touch": self.touch_port,
        }


class ChassisBody(Protocol):
    """Interface to the motors, sensors and console of this brick or of a remote brick."""

    def open(self) -> Sequence[float]:
        """Stop the motors; return each wheel's top speed, in degrees a second."""

    def run(self, left_dps: float, right_dps: float, time_ms: int) -> None:
        """Turn the wheels for at most `time_ms`."""

    def stop(self) -> None:
        """Stop the motors; never raises."""

    def positions(self) -> list[float]:
        """Return the angle by which each wheel has turned, in degrees."""

    def sense(self) -> dict[str, Any]:
        """Return the fields of `Sensors` that the body measures."""

    def take_button(self) -> str | None:
        """Return the button that was pressed since the last call."""

    def show(self, mode: str, address: str) -> None:
        """Show mode and address; never raises."""

    def close(self) -> None:
        """Stop the motors and close the devices; idempotent."""


def wheels_of(options: ChassisOptions) -> TwoWheels:
    """Return the speeds of the wheels, in degrees a second."""
    straight = options.forward_speed_mps * options.degrees_per_m
    # If only one wheel turns, the robot drives a circle of radius track_m about the other wheel.
    turn = math.radians(options.turn_rate_deg_s) * options.track_m * options.degrees_per_m
    left = {"backward": (-turn, 0.0), "forward": (0.0, turn), "both": (-turn / 2, turn / 2)}
    return TwoWheels(ahead=straight, back=straight, turn=left[options.turn_by], spin=turn / 2)


class ChassisDriver(ConnectedDriver[ChassisBody]):
    """Base class of drivers whose body is a `ChassisBody`; a subclass makes the body."""

    default_camera: ClassVar[str] = "v4l2"
    declared_moves = tuple(CLASSIC.values())
    takes_points = True
    turns_motors: ClassVar[bool] = True

    options: ChassisOptions

    def __init__(self, options: ChassisOptions, clock: Clock | None = None) -> None:
        super().__init__(options, clock)
        self._wheels = wheels_of(options)
        self._address = ""
        self._top_dps: Pair | None = None
        self._reckoning = DeadReckoning(options.track_m)

    def wheels_mps(self, action: Action, point: Point | None = None) -> Pair:
        """Return the speeds of the left and right wheel at full speed (a `speed_scale` of 1)."""
        if action is Action.STOP:
            return 0.0, 0.0
        return self._in_m(*self._wheels.at(point or CLASSIC_POINTS[action], self._top_dps))

    def drive(
        self, action: Action, point: Point | None = None, *, speed_scale: float = 1.0
    ) -> Action:
        """See `Driver`. The pose is estimated from the speeds before any correction of reversed or
        swapped motors."""
        sent = super().drive(action, point, speed_scale=speed_scale)
        left_mps, right_mps = self.wheels_mps(sent, point)
        speeds_mps = speed_scale * left_mps, speed_scale * right_mps
        self._reckoning.tell(speeds_mps, self._clock.now_s())
        return sent

    def _in_m(self, left_deg: float, right_deg: float) -> Pair:
        """Convert the angles of the motors to the distances that the wheels roll ahead."""
        return left_deg / self.options.degrees_per_m, right_deg / self.options.degrees_per_m

    @abstractmethod
    def _open(self) -> ChassisBody:
        """Return the body; `_begin` opens it later."""

    def _begin(self) -> None:
        left_dps, right_dps = self._connected().open()
        self._top_dps = left_dps, right_dps
        self._check_speeds(self._top_dps)
        self.show(Mode.STOPPED)

    def _close(self, connection: ChassisBody) -> None:
        connection.close()

    def _check_speeds(self, top_dps: Pair) -> None:
        """Raise ConfigurationError if a move needs a higher speed than a motor can reach."""
        options = self.options
        ports = (options.left_port, options.right_port)
        for name, value, move in (
            ("forward_speed_mps", options.forward_speed_mps, Action.FORWARD),
            ("turn_rate_deg_s", options.turn_rate_deg_s, Action.LEFT),
            ("turn_rate_deg_s", options.turn_rate_deg_s, Action.SPIN_LEFT),
        ):
            for port, asked, top in zip(
                ports, self._wheels.at(CLASSIC_POINTS[move]), top_dps, strict=True
            ):
                if abs(asked) > top:
                    most = math.floor(1000 * value * top / abs(asked)) / 1000
                    raise ConfigurationError(
                        f"--{name.replace('_', '-')} {value} needs {abs(asked):.0f} degrees a "
                        f"second from the motor at {port}, which reaches only {top:.0f}; "
                        f"choose {most} or less"
                    )

    def _drive(self, action: Action, point: Point | None, speed_scale: float) -> None:
        """Run the wheels for `ACTION_TIMEOUT_S`; the brick itself ends the move."""
        connection = self._connected()
        if action is Action.STOP:
            connection.stop()
            return
        wheels_dps = self._wheels.at(point or CLASSIC_POINTS[action], self._top_dps)
        left, right = self.correction.motors(wheels_dps)
        left, right = speed_scale * left, speed_scale * right
        connection.run(left, right, round(1000 * ACTION_TIMEOUT_S))

    def sense(self) -> Sensors:
        read = self._connected().sense()
        turned_deg = read.pop("wheels_deg", None)  # agents of older releases do not send this field
        wheels_m = self._in_m(*self.correction.wheels(turned_deg)) if turned_deg else None
        bumpers = tuple(read.pop("bumpers", None) or ())
        pose = self._reckoning.locate(wheels_m, self._clock.now_s())
        return Sensors(**read, bumpers=bumpers, pose=pose)

    def stop(self) -> None:
        self._reckoning.tell((0.0, 0.0), self._clock.now_s())
        if self._connection is not None:
            self._connection.stop()

    def rolled_m(self) -> Pair:
        """Return the distances rolled by the left and the right wheel, from the motors' counts."""
        left_deg, right_deg = self._connected().positions()
        return self._in_m(*self.correction.wheels((left_deg, right_deg)))

    def roll(self, action: Action, seconds: float) -> Pair:
        """Drive for some seconds; return the distance that each wheel rolled.

        The function repeats a command that is valid only for a short time, so the robot stops if
        this program ends.
        """
        before, end_s = self.rolled_m(), self._clock.now_s() + seconds
        try:
            while (left_s := end_s - self._clock.now_s()) > 0:
                self.send_action(action)
                self._clock.sleep(min(ACTION_TIMEOUT_S / 4, left_s))
        finally:
            self.stop()
        self._clock.sleep(0.3)  # wait until the robot stands still
        after = self.rolled_m()
        return after[0] - before[0], after[1] - before[1]

    def take_button(self) -> BodyButton | None:
        pressed = self._connection.take_button() if self._connection is not None else None
        return BodyButton(pressed) if pressed else None

    def announce(self, address: str) -> None:
        self._address = address

    def show(self, mode: Mode) -> None:
        if self._connection is not None:
            self._connection.show(mode.value, self._address)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ev3Options(ChassisOptions):
    """The robot's dimensions, and the ports of its devices."""

    brick_root: str = option("/", "folder that contains the brick's folders sys and dev")


class Ev3Driver(ChassisDriver):
    """A Lego Mindstorms EV3 that runs the server itself."""

    name: ClassVar[str] = "ev3"
    options_type: ClassVar[type[Any]] = Ev3Options
    options: Ev3Options

    def _open(self) -> ChassisBody:
        if importlib.util.find_spec("ev3dev2") is None:
            raise MissingExtraError("driving an EV3", "ev3")
        clock = SimpleNamespace(monotonic=self._clock.now_s, sleep=self._clock.sleep)
        return BrickBody(self.options.ports(), self.options.brick_root, clock)
