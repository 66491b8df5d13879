"""A robot on the test bench: its camera shows given pictures, and its body records orders.

Camera and body are real implementations of the interfaces; only the world is missing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from robot.camera import Camera
from robot.clock import Clock
from robot.control.config import LoopConfig
from robot.control.state import Tick
from robot.devices.rig import Rig
from robot.driver import Driver, Sensors
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.testing import VirtualClock
from robot.testing.driver import FakeDriver
from robot.types import Action, Encoding, Frame, Mode, PilotCommand, Point


@dataclass(frozen=True, slots=True, kw_only=True)
class NoOptions:
    """The camera has no options."""


class BenchCamera(Camera):
    """Shows the pictures that a test gives it."""

    name: ClassVar[str] = "bench"
    options_type: ClassVar[type[Any]] = NoOptions

    @classmethod
    def for_driver(cls, driver: Driver, options: Any, clock: Clock) -> Self:
        return cls(clock)

    def start(self) -> None: ...

    def stop(self) -> None: ...

    def show(self, scene: int, captured_s: float | None = None) -> Frame:
        """Publish the picture of the scene with this number; equal numbers have equal pictures.

        `captured_s` is the time at which the picture was taken; None means now.
        """
        pixels = np.random.default_rng(scene).integers(0, 256, (8, 8, 3), dtype=np.uint8)
        picture = pixels.repeat(15, axis=0).repeat(20, axis=1)
        return self._publish(
            picture.tobytes(),
            width=160,
            height=120,
            encoding=Encoding.RGB,
            captured_s=self.clock.now_s() if captured_s is None else captured_s,
        )

    def show_rubbish(self) -> Frame:
        """Publish bytes that are not a picture."""
        return self._publish(
            b"no picture",
            width=160,
            height=120,
            encoding=Encoding.RGB,
            captured_s=self.clock.now_s(),
        )

    def break_down(self, sentence: str) -> None:
        self._report_fault(sentence)


class BenchDriver(FakeDriver):
    """Records its orders and displayed modes; a test can make the body fail."""

    name: ClassVar[str] = "bench"
    default_camera: ClassVar[str] = "bench"
    options_type: ClassVar[type[Any]] = NoOptions

    def __init__(self, options: Any = None, clock: Clock | None = None) -> None:
        super().__init__(options, clock)
        self.sensors = Sensors(distance_m=0.5, bumped=False)
        self.shown: list[Mode] = []

    def show(self, mode: Mode) -> None:
        self.shown.append(mode)


class BenchRobot:
    """Loop, camera and body on a clock that the test moves, with a pilot's hand on the pad."""

    def __init__(
        self, learner: str | Policy = "published-8", config: LoopConfig | None = None
    ) -> None:
        self.clock = VirtualClock(100.0)
        self.camera = BenchCamera(self.clock)
        self.driver = BenchDriver(clock=self.clock)
        policy = make_policy(learner) if isinstance(learner, str) else learner
        self.rig = Rig(self.driver, self.camera, policy, self.clock, config)
        self.loop = self.rig.loop
        self._seq = 0

    def start(self, mode: Mode, scene: int = 0) -> None:
        """Show a first picture and choose a mode."""
        self.camera.show(scene)
        taken = self.loop.set_mode(mode)
        self.tick()
        assert taken.result(0)

    def hold(self, action: Action | None, frame_id: int | None = None, **more: Any) -> None:
        """Send the held move, for `frame_id` or else for the newest frame.

        `more` has other fields of the command.
        """
        frame = self.camera.latest()
        seen = frame_id if frame_id is not None else frame.frame_id if frame else None
        self._seq += 1
        self.loop.command(
            PilotCommand(
                held=action,
                frame_id=seen,
                seq=self._seq,
                received_s=self.clock.now_s(),
                **more,
            )
        )

    def tick(self) -> Tick:
        return self.loop.tick(self.clock.now_s())

    def step(
        self,
        scene: int,
        held: Action | None,
        seconds: float = 0.05,
        point: Point | None = None,
    ) -> Tick:
        """Let time pass: a new picture arrives, the pilot holds a move, and the loop ticks."""
        self.clock.sleep(seconds)
        self.camera.show(scene)
        self.tick()
        self.hold(held, point=point)
        return self.tick()


def started(mode: Mode = Mode.TRAIN, config: LoopConfig | None = None) -> BenchRobot:
    """Return a robot that is in this mode and was taught one example."""
    robot = BenchRobot(config=config)
    robot.start(Mode.TRAIN)
    robot.step(1, Action.FORWARD)
    if mode is not Mode.TRAIN:
        robot.start(mode, scene=1)
    return robot
