"""The simulated robot's camera; in real time its thread is also what moves the world on."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol, Self, runtime_checkable

from robot.camera import Camera
from robot.clock import Clock
from robot.driver import Driver
from robot.errors import CameraError, ConfigurationError, RobotError
from robot.simulation.renderer import HEIGHT_PX, WIDTH_PX
from robot.simulation.simulation import Simulation
from robot.types import Encoding, Frame

_LONGEST_GAP_S = 0.25
"""After a longer pause of the whole machine the world goes on from where it stood."""


@runtime_checkable
class SimulatedBody(Protocol):
    """A driver that moves a simulation."""

    simulation: Simulation

    def advance(self, dt_s: float) -> None:
        """Let time pass in the world."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class SimCameraOptions:
    """What a person may choose."""

    frame_rate_hz: float = field(default=30.0, metadata={"help": "simulated pictures a second"})


class SimCamera(Camera):
    """Renders what the simulated robot sees."""

    name: ClassVar[str] = "sim"
    options_type: ClassVar[type[Any]] = SimCameraOptions

    def __init__(self, body: SimulatedBody, options: SimCameraOptions, clock: Clock) -> None:
        super().__init__(clock)
        if not 1.0 <= options.frame_rate_hz <= 120.0:
            raise ConfigurationError(
                f"--frame-rate-hz must lie between 1 and 120, not {options.frame_rate_hz:g}"
            )
        self._body = body
        self._period_s = 1.0 / options.frame_rate_hz
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None
        self._failure: RobotError | None = None

    @classmethod
    def for_driver(cls, driver: Driver, options: Any, clock: Clock) -> Self:
        """Look out of a simulated body."""
        if not isinstance(driver, SimulatedBody):
            raise ConfigurationError(
                f"the camera 'sim' only works with a simulated robot, not with {driver.name!r}"
            )
        return cls(driver, options, clock)

    def start(self) -> None:
        """Begin to take pictures in real time; returns when the first is there."""
        if self._thread is not None:
            return
        self._ending.clear()
        self._failure = None
        first = threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(first,), name="sim-camera", daemon=True
        )
        self._thread.start()
        first.wait(timeout=20.0)
        if self._failure is not None:
            self.stop()
            raise self._failure
        if self.latest() is None:
            raise CameraError("the simulated camera gives no picture")

    def stop(self) -> None:
        """End the thread."""
        if self._thread is not None:
            self._ending.set()
            self._thread.join(timeout=5.0)
            self._thread = None

    def capture(self) -> Frame:
        """Take one picture now, on this thread: for experiments, which use no `start`."""
        picture = self._body.simulation.render()
        return self._publish(
            picture.tobytes(),
            width=WIDTH_PX,
            height=HEIGHT_PX,
            encoding=Encoding.RGB,
            captured_s=self.clock.now_s(),
        )

    def _run(self, first: threading.Event) -> None:
        try:
            self.capture()
            first.set()
            self._run_in_real_time()
        except RobotError as error:
            self._failure = error
            self._report_fault(str(error))
            first.set()
        finally:
            self._body.simulation.close()

    def _run_in_real_time(self) -> None:
        last_s = self.clock.now_s()
        due_s = last_s + self._period_s
        while not self._ending.wait(max(0.0, due_s - self.clock.now_s())):
            now_s = self.clock.now_s()
            self._body.advance(min(now_s - last_s, _LONGEST_GAP_S))
            last_s = now_s
            self.capture()
            due_s = max(due_s + self._period_s, now_s)
