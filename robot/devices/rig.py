"""Assembles a complete robot from names: the body, the camera, the policy and the loop."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Mapping
from typing import Any

from robot.camera import Camera
from robot.clock import Clock, RealClock, Worker
from robot.control.config import LoopConfig
from robot.control.loop import ControlLoop
from robot.control.state import Tick
from robot.devices.driver_thread import DriverThread
from robot.devices.options import make_options
from robot.devices.plugins import load_camera, load_driver
from robot.driver import Driver
from robot.errors import PluginError, PluginErrors, RobotError
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.types import Frame, StartStop, StopReason


class Rig(StartStop):
    """Owns the robot's parts, and starts and stops them in the right order. A context manager.

    The loop ticks on a separate thread, for each new frame, command or request, and at least every
    50 ms.
    """

    def __init__(
        self,
        driver: Driver,
        camera: Camera,
        policy: Policy,
        clock: Clock | None = None,
        config: LoopConfig | None = None,
    ) -> None:
        self.clock = clock or RealClock()
        self.driver, self.camera = driver, camera
        self.loop = ControlLoop(driver, camera, policy, self.clock, config)
        self._ending = threading.Event()
        self._thread: Worker | None = None
        if driver.takes_advice:
            self.loop.subscribe(self._advise)

    def start(self) -> None:
        """Connect the body, start the camera, and run the loop. If hardware is missing, stop the
        parts that were started, and raise RobotError."""
        try:
            with self.loop.body.errors.named("connect"):
                self.driver.connect()
            with self.loop.camera_errors.named("start"):
                self.camera.start()
        except BaseException:
            with contextlib.suppress(RobotError):  # raise the first error
                self.stop()
            raise
        if self._thread is None:
            self._ending.clear()
            self.loop.body.start()
            self._thread = self.clock.start_thread(self._run, "control-loop")

    def stop(self) -> None:
        """Stop the robot, end the thread, and release the camera and the body."""
        if self._thread is not None:
            self.loop.trip(StopReason.PILOT_GONE)
            self._ending.set()
            self.loop.wake.set()
            self._thread.join(timeout=5.0)
            self._thread = None
            self.loop.body.stop()
        try:
            with self.loop.camera_errors.named("stop"):
                self.camera.stop()
        finally:
            with self.loop.body.errors.named("disconnect"):
                self.driver.disconnect()

    def _run(self) -> None:
        while not self._ending.is_set():
            self.clock.wait(self.loop.wake, self.loop.wait_s)
            self.loop.wake.clear()
            self.loop.tick(self.clock.now_s())
        self.loop.tick(self.clock.now_s())

    def _advise(self, tick: Tick) -> None:
        if tick.frame is not None and tick.prediction is not None:
            self.loop.body.ask("advise", tick.prediction)

    def for_the_eye(self, frame: Frame) -> Frame:
        """Return the camera's larger picture of `frame`; if the camera fails, return `frame`."""
        try:
            return self.camera.for_the_eye(frame)
        except Exception as error:
            self.loop.camera_errors.converted("for_the_eye", error)  # logs the error once
            return frame


def build_rig(
    robot: str,
    *,
    camera: str | None = None,
    learner: str = "default-32",
    options: Mapping[str, Any] | None = None,
    config: LoopConfig | None = None,
) -> Rig:
    """Assemble a robot from names; no device is opened before `start`.

    Args:
        robot: Name of a driver.
        camera: Name of a camera; None for the driver's default.
        learner: Name of a policy, such as `default-32`.
        options: Values for the options that driver and camera declare, by name.
        config: The loop's limits.

    Raises:
        RobotError: If a name is unknown, an option is invalid, or a library is missing.
    """
    given, clock = options or {}, RealClock()
    driver_type = load_driver(robot)
    with PluginErrors("robot", robot, PluginError).named("__init__"):
        driver = driver_type(make_options(driver_type.options_type, given))
        moves = driver.first_moves
    camera_type = load_camera(camera or driver_type.default_camera)
    with PluginErrors("camera", camera_type.name, PluginError).named("for_driver"):
        eye = camera_type.for_driver(driver, make_options(camera_type.options_type, given), clock)
    body = DriverThread(driver, clock) if driver.is_remote else driver
    return Rig(body, eye, make_policy(learner, moves=moves), clock, config)
