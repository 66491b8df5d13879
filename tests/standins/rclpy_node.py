"""Runs docs/examples/ros/watchdog.py with stand-ins for rclpy and its messages.

The names and signatures follow the documents of rclpy's Node and of Jazzy's messages; no ROS checks
them here.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

from robot.clock import Clock, Worker
from tests.standins.firmware import ROOT
from tests.standins.firmware_in_time import OverError, modules

PROGRAM = ROOT / "docs/examples/ros/watchdog.py"
Publish = Callable[[str, str, dict[str, Any]], None]


@dataclass
class Vector3:
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


@dataclass
class Twist:
    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)


@dataclass
class Time:
    sec: int = 0
    nanosec: int = 0


@dataclass
class Header:
    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass
class TwistStamped:
    header: Header = field(default_factory=Header)
    twist: Twist = field(default_factory=Twist)


_PACKAGES = {Twist: "geometry_msgs", TwistStamped: "geometry_msgs", Header: "std_msgs"}


class WatchdogNode:
    """The running watchdog: `take` gives it an order, and `publish` gets all that it publishes.

    Args:
        clock: The node's clock.
        publish: Called with the topic, type and message of each publication.
        parameters: The node's parameters, as set by `--ros-args -p NAME:=VALUE`.
    """

    def __init__(self, clock: Clock, publish: Publish, **parameters: Any) -> None:
        self._clock, self._publish, self._parameters = clock, publish, parameters
        self.subscribed: dict[str, tuple[type, Callable[[Any], None]]] = {}
        self._timers: list[tuple[float, Callable[[], None]]] = []
        self._ending = threading.Event()
        self._turn = threading.Lock()
        self._thread: Worker | None = None

    def start(self) -> None:
        self._thread = self._clock.start_thread(self._run, "watchdog")

    def end(self) -> None:
        """End like Ctrl-C."""
        self._ending.set()
        assert self._thread is not None
        self._thread.join()

    def take(self, message: dict[str, Any]) -> None:
        """Give the node an order in JSON form."""
        self.hear("/drivelesson/cmd_vel", message)

    def hear(self, topic: str, message: dict[str, Any]) -> None:
        """Give the node a message of a topic to which it subscribes."""
        kind, take = self.subscribed[topic]
        told = _twist(message)
        if kind is TwistStamped:
            header = message["header"]
            told = TwistStamped(
                Header(Time(**header["stamp"]), header["frame_id"]), _twist(message["twist"])
            )
        with self._turn:  # one call at a time, like rclpy's executor
            take(told)

    def _run(self) -> None:
        running = self

        class Node:
            def __init__(self, name: str) -> None:
                assert name.isidentifier()

            def declare_parameter(self, name: str, default: Any) -> Any:
                return SimpleNamespace(value=running._parameters.get(name, default))

            def create_publisher(self, kind: type, topic: str, depth: int) -> Any:
                name = f"{_PACKAGES[kind]}/msg/{kind.__name__}"

                def publish(message: Any) -> None:
                    assert type(message) is kind, "rclpy refuses a message of another type"
                    running._publish(topic, name, to_json(message))

                return SimpleNamespace(publish=publish)

            def create_subscription(
                self, kind: type, topic: str, take: Callable[[Any], None], depth: int
            ) -> None:
                running.subscribed[topic] = kind, take

            def create_timer(self, every_s: float, run: Callable[[], None]) -> None:
                running._timers.append((every_s, run))

            def get_clock(self) -> Any:
                now = Time(int(running._clock.wall_s()), 0)
                return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: now))

        names = modules(
            rclpy=SimpleNamespace(init=lambda signal_handler_options: None, spin=self._spin),
            time=SimpleNamespace(monotonic=self._clock.now_s),
            **{
                "rclpy.signals": SimpleNamespace(SignalHandlerOptions=SimpleNamespace(NO=0)),
                "rclpy.node": SimpleNamespace(Node=Node),
                "geometry_msgs.msg": SimpleNamespace(Twist=Twist, TwistStamped=TwistStamped),
                "std_msgs.msg": SimpleNamespace(Header=Header),
            },
        )
        exec(compile(PROGRAM.read_text(), str(PROGRAM), "exec"), names)
        try:
            names["main"]()
        except OverError:
            return

    def _spin(self, node: Any) -> None:
        ((every_s, run),) = self._timers
        while not self._clock.wait(self._ending, every_s):
            with self._turn:
                run()
        raise OverError


def _twist(message: dict[str, Any]) -> Any:
    told = {name: Vector3(**message[name]) for name in ("linear", "angular") if name in message}
    return Twist(**told)


def to_json(message: Any) -> Any:
    """Return a message as rosbridge writes it."""
    if not hasattr(message, "__dataclass_fields__"):
        return message
    return {name: to_json(getattr(message, name)) for name in message.__dataclass_fields__}
