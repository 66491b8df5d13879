"""A ROS 2 robot by rosbridge: velocities on one topic, what the learner would do on another."""

from __future__ import annotations

import contextlib
import json
import math
import threading
from dataclasses import dataclass
from typing import Any, ClassVar

from robot.bodies.remote.orders import moves_option, parse_moves
from robot.bodies.ros.bridge import GONE_S, Message, RosBridge
from robot.bodies.ros.refusals import advice_for
from robot.clock import Clock
from robot.devices.options import Options, option
from robot.devkit.connected_driver import ConnectedDriver
from robot.driver import ACTION_TIMEOUT_S, point_of
from robot.errors import ConfigurationError, DriveError
from robot.types import Action, Point, Prediction, Sensors

_TWIST, _STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
_TEXT, _HEADER = "std_msgs/msg/String", "std_msgs/msg/Header"
_ORDERS, _ALIVE = "/drivelesson/cmd_vel", "/drivelesson/alive"
"""Topics of docs/examples/ros/watchdog.py: velocities to it, and its signs of life."""
_FIRST_SIGN_S = 3.0
_STANDS = Point(0.0, 0.0)
_NO_WATCHDOG = "the robot's watchdog gives no sign of life; does watchdog.py run there?"


@dataclass(frozen=True, slots=True, kw_only=True)
class RosOptions(Options):
    """Where rosbridge is, and how its robot moves."""

    address: str = option("", "HOST of rosbridge, or HOST:PORT")
    cmd_vel_topic: str = option("/cmd_vel", "topic of the velocities")
    stamped: bool = option(False, "the robot takes TwistStamped instead of Twist")
    watchdog: bool = option(
        False, "the robot runs our watchdog.py, which takes the velocities and stops it"
    )
    linear_mps: float = option(
        0.4, "metres a second at full throttle; forward is half of it", range=(0.001, 5.0)
    )
    turn_rate_deg_s: float = option(45.0, "degrees a second at full steering", range=(0.1, 720.0))
    body_moves: str = moves_option("forward,left,right,backward,spin_left,spin_right")
    advice_topic: str = option("", "topic for what the learner would do, as JSON text; empty: none")

    def check(self) -> None:
        check_topic("--cmd-vel-topic", self.cmd_vel_topic)
        if self.advice_topic:
            check_topic("--advice-topic", self.advice_topic)


def check_topic(flag: str, name: str) -> None:
    """Raise ConfigurationError unless this is the name of a topic."""
    words = name.removeprefix("/").split("/")
    if not all(word.isidentifier() and word.isascii() for word in words):
        raise ConfigurationError(f"{flag} must be a topic's name, as /cmd_vel, not {name!r}")


class RosDriver(ConnectedDriver[RosBridge]):
    """Publishes a velocity for as long as a move lasts, then zero.

    Nothing stops the robot if this program, its computer or the network fails, unless the robot's
    own base ends a velocity that is not renewed: `cmd_vel` carries no duration. With `watchdog`
    our node on the robot does: each order carries its newest sign of life, and ends soon after.
    """

    name: ClassVar[str] = "ros"
    default_camera: ClassVar[str] = "ros"
    options_type: ClassVar[type[Any]] = RosOptions
    is_remote: ClassVar[bool] = True
    bridge_type: ClassVar[type[RosBridge]] = RosBridge
    takes_points = True

    def __init__(self, options: RosOptions, clock: Clock | None = None) -> None:
        super().__init__(options, clock)
        self.declared_moves = parse_moves(options.body_moves)
        without = [move.name for move in self.declared_moves if move.point is None]
        if without:
            raise ConfigurationError(
                f"--body-moves: {without[0]!r} needs steering and throttle for a ROS robot, as in "
                f"{without[0]}:0:1"
            )
        self._is_stamped = options.stamped or options.watchdog
        self._topic = _ORDERS if options.watchdog else options.cmd_vel_topic
        self._sign: dict[str, Any] = {"sec": 0, "nanosec": 0}
        self._signed_s = 0.0
        self._has_signed = threading.Event()

    @property
    def takes_advice(self) -> bool:
        return bool(self.options.advice_topic)

    def _open(self) -> RosBridge:
        options = self.options
        advertised = {self._topic: _STAMPED if self._is_stamped else _TWIST}
        if options.advice_topic:
            advertised[options.advice_topic] = _TEXT
        return self.bridge_type(
            options.address,
            self._clock,
            advertised=advertised,
            subscribed={_ALIVE: _HEADER} if options.watchdog else {},
            on_message=self._take_sign,
        )

    def _begin(self) -> None:
        self._has_signed.clear()
        if self.options.watchdog and not self._clock.wait(self._has_signed, _FIRST_SIGN_S):
            raise DriveError(f"rosbridge at {self.options.address} is there, but {_NO_WATCHDOG}")
        self.stop()

    def _close(self, connection: RosBridge) -> None:
        connection.close()

    def _drive(self, action: Action, point: Point | None, speed_scale: float) -> None:
        """Publish the velocity, and zero after `ACTION_TIMEOUT_S`."""
        connection = self._connected()
        steering, throttle = point or point_of(action, self.declared_moves) or _STANDS
        ends = (self.velocity(0.0, 0.0), ACTION_TIMEOUT_S) if steering or throttle else None
        message = self.velocity(speed_scale * steering, speed_scale * throttle)
        try:
            connection.publish(self._topic, message, ends)
        except OSError as error:
            raise DriveError(f"rosbridge takes no velocity: {error or 'too slow'}") from error
        self._check_heard(connection)

    def sense(self) -> Sensors:
        """Sense nothing but that the bridge is there and refuses nothing."""
        self._check_heard(self._connected())
        return Sensors()

    def stop(self) -> None:
        if self._connection is not None:
            with contextlib.suppress(OSError):  # the next request says so
                self._connection.publish(self._topic, self.velocity(0.0, 0.0))

    def advise(self, prediction: Prediction) -> None:
        bridge = self._connection
        if bridge is None or not self.takes_advice:
            return
        told = {
            "move": None if prediction.action is None else str(prediction.action),
            "confidence": round(prediction.confidence, 4),
            "novel": prediction.is_novel,
            "frame": prediction.frame_id,
        }
        bridge.publish_soon(self.options.advice_topic, {"data": json.dumps(told)})

    def velocity(self, steering: float, throttle: float) -> dict[str, Any]:
        """Return the message for a point of steering and throttle: metres and radians a second."""
        turn = -steering * math.radians(self.options.turn_rate_deg_s)
        twist = {
            "linear": {"x": throttle * self.options.linear_mps, "y": 0.0, "z": 0.0},
            "angular": {"x": 0.0, "y": 0.0, "z": turn + 0.0},
        }
        if not self._is_stamped:
            return twist
        stamp = self._sign
        if not self.options.watchdog:
            seconds, rest = divmod(self._clock.wall_s(), 1.0)
            stamp = {"sec": int(seconds), "nanosec": int(rest * 1e9)}
        return {"header": {"stamp": stamp, "frame_id": "base_link"}, "twist": twist}

    def _check_heard(self, bridge: RosBridge) -> None:
        if refusal := bridge.refusal:
            has_watchdog = self.options.watchdog
            do = advice_for(refusal, is_stamped=self._is_stamped, has_watchdog=has_watchdog)
            raise DriveError(
                f"rosbridge at {self.options.address} refuses: {refusal}"
                + (f"; {do}" if do else "")
            )
        if bridge.silent_s > GONE_S:
            trouble = f" ({bridge.trouble})" if bridge.trouble else ""
            stops = "nothing stops its robot unless its base does"
            if self.options.watchdog:
                stops = "the watchdog on the robot stops it"
            raise DriveError(
                f"rosbridge at {self.options.address} has not answered for {bridge.silent_s:.1f} s"
                f"{trouble}; {stops}"
            )
        if self.options.watchdog and self._clock.now_s() - self._signed_s > GONE_S:
            raise DriveError(_NO_WATCHDOG)

    def _take_sign(self, topic: str, message: Message) -> None:
        """Take the watchdog's sign of life, on the bridge's thread."""
        stamp = message.get("stamp")
        if isinstance(stamp, dict) and all(isinstance(n, int) for n in stamp.values()):
            self._sign, self._signed_s = dict(stamp), self._clock.now_s()
            self._has_signed.set()
