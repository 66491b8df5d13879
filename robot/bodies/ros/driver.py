"""A ROS 2 robot: velocities on one topic, the learner's proposals on another."""

from __future__ import annotations

import contextlib
import json
import math
import secrets
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from robot.bodies.remote.orders import moves_option, parse_moves
from robot.bodies.ros.refusals import advice_for
from robot.bodies.ros.topics import (
    GONE_S,
    HEADER,
    ODOMETRY,
    RANGE,
    STAMPED,
    TEXT,
    TWIST,
    Message,
    Topics,
    check_topic,
)
from robot.bodies.ros.transport import DDS, TransportOptions, open_topics
from robot.clock import Clock
from robot.devices.options import option
from robot.devkit.connected_driver import ConnectedDriver
from robot.driver import ACTION_TIMEOUT_S, Pose, Sensors
from robot.errors import ConfigurationError, DriveError
from robot.moves import point_of
from robot.types import Action, Point, Prediction

ORDERS, ALIVE = "/drivelesson/cmd_vel", "/drivelesson/alive"
"""Topics of docs/examples/ros/watchdog.py: velocities to the watchdog, and its signs of life."""
_DISPUTED = "disputed"
"""Frame id of the watchdog's signs of life while a second program sends velocities to the robot."""
_FIRST_SIGN_S = 3.0
_FRESH_S = 1.0
"""A sensor's value is ignored from this age on, in seconds."""
_STANDS = Point(0.0, 0.0)
_NO_WATCHDOG = "the robot's watchdog does not answer; is watchdog.py running there?"


@dataclass(frozen=True, slots=True, kw_only=True)
class RosOptions(TransportOptions):
    """The robot's address, topics and speeds."""

    cmd_vel_topic: str = option("/cmd_vel", "topic of the velocities")
    stamped: bool = option(False, "true if the robot expects TwistStamped instead of Twist")
    watchdog: bool = option(False, "true if Drivelesson's watchdog.py runs on the robot")
    linear_mps: float = option(
        0.4,
        "speed at full throttle in metres a second; `forward` uses half of this speed",
        range=(0.001, 5.0),
    )
    turn_rate_deg_s: float = option(45.0, "turning rate at full steering", range=(0.1, 720.0))
    body_moves: str = moves_option("forward,left,right,backward,spin_left,spin_right")
    odometry_topic: str = option("", "topic of the odometry, such as /odom; empty for none")
    range_topic: str = option("", "topic of the distance ahead (sensor_msgs/Range); empty for none")
    advice_topic: str = option("", "topic of the learner's proposals (JSON text); empty for none")

    def check(self) -> None:
        self.check_transport()
        check_topic("--cmd-vel-topic", self.cmd_vel_topic)
        for name in ("odometry_topic", "range_topic", "advice_topic"):
            if topic := getattr(self, name):
                check_topic(f"--{name.replace('_', '-')}", topic)


class RosDriver(ConnectedDriver[Topics]):
    """Publishes a velocity for as long as a move lasts, then zero.

    `cmd_vel` contains no duration. If this program, its computer or the network fails, nobody sends
    a zero. The robot then stops only if its base has a timeout for velocities. With `watchdog`, a
    node of this project on the robot stops the robot. The node sends signs of life that contain its
    time, and each order contains the newest of these times. The node stops the robot as soon as the
    time in the last order is too old.
    """

    name: ClassVar[str] = "ros"
    default_camera: ClassVar[str] = "ros"
    options_type: ClassVar[type[Any]] = RosOptions
    is_remote: ClassVar[bool] = True
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
        self._topic = ORDERS if options.watchdog else options.cmd_vel_topic
        self._sign: dict[str, Any] = {"sec": 0, "nanosec": 0}
        self._signed_s, self._is_disputed = 0.0, False
        self._frame = f"drivelesson_{secrets.token_hex(4)}" if options.watchdog else "base_link"
        self._has_signed = threading.Event()
        self._sensed: dict[str, tuple[float, Any]] = {}
        self.open_topics: Callable[..., Topics] = open_topics

    @property
    def takes_advice(self) -> bool:
        return bool(self.options.advice_topic)

    def _open(self) -> Topics:
        options = self.options
        advertised = {self._topic: STAMPED if self._is_stamped else TWIST}
        if options.advice_topic:
            advertised[options.advice_topic] = TEXT
        listens = {
            ALIVE: HEADER if options.watchdog else "",
            options.odometry_topic: ODOMETRY,
            options.range_topic: RANGE,
        }
        return self.open_topics(
            options,
            self._clock,
            advertised=advertised,
            subscribed={topic: kind for topic, kind in listens.items() if topic and kind},
            on_message=self._take_message,
        )

    def _begin(self) -> None:
        self._has_signed.clear()
        if self.options.transport == DDS:  # DDS knows the subscribers immediately
            self._check_taken(self._connected())
        if self.options.watchdog and not self._clock.wait(self._has_signed, _FIRST_SIGN_S):
            raise DriveError(f"{self._connected().where} answers, but {_NO_WATCHDOG}")

    def _close(self, connection: Topics) -> None:
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
            raise DriveError(
                f"{connection.where} does not accept velocities: "
                f"{error or 'it took too long to answer'}"
            ) from error
        # The check comes last, so that a stop is sent even if the connection has a fault.
        if ends is not None:
            self._check_heard(connection)

    def _sense(self) -> Sensors:
        """Check that the robot answers and refuses no message; return the newest sensor values."""
        self._check_heard(self._connected())
        now_s = self._clock.now_s()
        fresh = {
            name: value for name, (at_s, value) in self._sensed.items() if now_s - at_s < _FRESH_S
        }
        return Sensors(**fresh)

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
        """Return the message for steering and throttle, in metres and radians a second."""
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
        return {"header": {"stamp": stamp, "frame_id": self._frame}, "twist": twist}

    def _check_taken(self, bridge: Topics) -> None:
        if refusal := bridge.refusal:
            has_watchdog = self.options.watchdog
            do = advice_for(refusal, is_stamped=self._is_stamped, has_watchdog=has_watchdog)
            raise DriveError(bridge.refused(refusal) + (f"; {do}" if do else ""))

    def _check_heard(self, bridge: Topics) -> None:
        self._check_taken(bridge)
        if bridge.silent_s > GONE_S:
            trouble = f" ({bridge.trouble})" if bridge.trouble else ""
            stops = "only the robot's own base can stop it now"
            if self.options.watchdog:
                stops = "the watchdog on the robot stops it"
            raise DriveError(
                f"{bridge.where} has not answered for {bridge.silent_s:.1f} s{trouble}; {stops}"
            )
        if self.options.watchdog and self._clock.now_s() - self._signed_s > GONE_S:
            raise DriveError(_NO_WATCHDOG)
        if self._is_disputed:
            raise DriveError(
                "the watchdog stopped the robot, because another node drives it at the same time; "
                f"`ros2 topic info -v {self.options.cmd_vel_topic}` on the robot lists these nodes"
            )

    def _take_message(self, topic: str, message: Message) -> None:
        """Receive a message, on the connection's thread; an unreadable message is ignored."""
        with contextlib.suppress(KeyError, TypeError, ValueError, OverflowError):
            if topic == ALIVE:
                self._take_sign(message)
            elif topic == self.options.odometry_topic:
                self._sensed["pose"] = self._clock.now_s(), _pose_of(message["pose"]["pose"])
            else:
                self._sensed["distance_m"] = self._clock.now_s(), _distance_of(message)

    def _take_sign(self, message: Message) -> None:
        """Receive the watchdog's sign of life."""
        stamp = message["stamp"]
        self._sign = {"sec": int(stamp["sec"]), "nanosec": int(stamp["nanosec"])}
        self._is_disputed = message.get("frame_id") == _DISPUTED
        self._signed_s = self._clock.now_s()
        self._has_signed.set()


def _pose_of(pose: Message) -> Pose:
    """Return the robot's pose by odometry, from a geometry_msgs/Pose."""
    at, turned = pose["position"], pose["orientation"]
    x, y, z, w = (float(turned[name]) for name in "xyzw")
    heading = math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    pose_now = Pose(x_m=float(at["x"]), y_m=float(at["y"]), heading_rad=heading, is_estimate=True)
    if not all(map(math.isfinite, (pose_now.x_m, pose_now.y_m, heading))):
        raise ValueError("the pose is not finite")
    return pose_now


def _distance_of(message: Message) -> float | None:
    """Return the distance in a sensor_msgs/Range; None outside its limits."""
    distance = float(message["range"])
    is_seen = float(message["min_range"]) <= distance <= float(message["max_range"])
    return distance if is_seen and math.isfinite(distance) else None
