"""A robot for measuring the link: a steady camera, and a driver that records its commands."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from robot.camera import Camera
from robot.clock import Clock
from robot.driver import Driver
from robot.errors import DriveError
from robot.types import Action, Encoding, Frame, Sensors

_PICTURES = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class _NoOptions:
    """Nothing to choose."""


class SteadyCamera(Camera):
    """Shows patterns at a steady rate, as heavy as JPEGs of a room. Can be frozen or broken."""

    name: ClassVar[str] = "steady"
    options_type: ClassVar[type[Any]] = _NoOptions

    def __init__(
        self, clock: Clock, rate_hz: float = 30.0, width: int = 160, height: int = 120
    ) -> None:
        super().__init__(clock)
        self.rate_hz, self.width, self.height = rate_hz, width, height
        self.is_frozen = False
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None
        self._pictures = [_pattern(seed, width, height) for seed in range(_PICTURES)]

    @classmethod
    def for_driver(cls, driver: Driver, options: Any, clock: Clock) -> Self:
        """Build one; it needs nothing of the body."""
        return cls(clock)

    def start(self) -> None:
        """Begin to take pictures."""
        self._thread = threading.Thread(target=self._run, name="steady-camera", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join()

    def break_down(self, sentence: str) -> None:
        """Freeze, and say what is wrong."""
        self.is_frozen = True
        self._report_fault(sentence)

    def _run(self) -> None:
        next_s = self.clock.now_s()
        while not self._ending.wait(max(0.0, next_s - self.clock.now_s())):
            next_s += 1 / self.rate_hz
            if not self.is_frozen:
                self.take()

    def take(self) -> Frame:
        """Take one picture now."""
        return self._publish(
            self._pictures[self._last_frame_id % _PICTURES],
            width=self.width,
            height=self.height,
            encoding=Encoding.RGB,
            captured_s=self.clock.now_s(),
        )


class NotingDriver(Driver):
    """Records each change and its last command to move (`moved_s`); can be made to fail."""

    name: ClassVar[str] = "noting"
    default_camera: ClassVar[str] = "steady"
    options_type: ClassVar[type[Any]] = _NoOptions

    def __init__(self, options: Any = None) -> None:
        self.now = Action.STOP
        self.changes: list[tuple[float, Action]] = []
        self.failure: str | None = None
        self.moved_s = 0.0

    @property
    def is_connected(self) -> bool:
        """Always."""
        return True

    def connect(self) -> None:
        """Do nothing: there is nothing to open."""

    def disconnect(self) -> None:
        """Stop."""
        self.stop()

    def send_action(self, action: Action, *, speed_scale: float = 1.0) -> Action:
        """Note the action."""
        if self.failure is not None:
            raise DriveError(self.failure)
        if action is not Action.STOP:
            self.moved_s = time.monotonic()
        self._note(action)
        return action

    def sense(self) -> Sensors:
        """Sense nothing."""
        return Sensors()

    def stop(self) -> None:
        """Note the stop."""
        self._note(Action.STOP)

    def _note(self, action: Action) -> None:
        if action is not self.now:
            self.now = action
            self.changes.append((time.monotonic(), action))


def _pattern(seed: int, width: int, height: int) -> bytes:
    """Return coloured blocks whose JPEG is about 5 KB at 160x120, 25 KB at 640x480."""
    block = 12 if width <= 160 else 36  # no multiple of 8, or JPEG would have an easy time
    shape = (height // block + 1, width // block + 1, 3)
    blocks = np.random.default_rng(seed).integers(60, 200, shape, dtype=np.uint8)
    picture = blocks.repeat(block, axis=0).repeat(block, axis=1)[:height, :width]
    return np.ascontiguousarray(picture).tobytes()
