"""A fake camera that takes pictures when a test requests them, or at a steady rate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Self

import numpy as np

from robot.clock import Clock
from robot.devices.options import Options
from robot.devkit.threaded_camera import ThreadedCamera
from robot.driver import Driver
from robot.types import Encoding, Frame

_PICTURES = 8
_WIDTH, _HEIGHT = 160, 120


class FakeCamera(ThreadedCamera):
    """Shows patterns, at a steady rate between `start` and `stop`. A test can freeze or break the
    camera.

    `pictures` are JPEGs that are shown in place of the patterns.

    Attributes:
        rate_hz: Pictures per second.
        age_s: Age of a picture on arrival, due to exposure and transfer, in seconds.
        is_frozen: True while the camera delivers no pictures.

    Example:
        >>> from robot.testing import VirtualClock
        >>> clock = VirtualClock()
        >>> with FakeCamera(clock, rate_hz=10.0) as camera:
        ...     clock.sleep(0.95)
        ...     camera.latest().frame_id
        10
    """

    name: ClassVar[str] = "fake"
    options_type: ClassVar[type[Any]] = Options

    def __init__(
        self,
        clock: Clock,
        rate_hz: float = 30.0,
        age_s: float = 0.0,
        pictures: Sequence[bytes] = (),
    ) -> None:
        super().__init__(Options(), clock)
        self.rate_hz, self.age_s = rate_hz, age_s
        self.is_frozen = False
        self._encoding = Encoding.JPEG if pictures else Encoding.RGB
        self._pictures = pictures or [_pattern(seed) for seed in range(_PICTURES)]

    @classmethod
    def for_driver(cls, driver: Driver, options: Any, clock: Clock) -> Self:
        return cls(clock)

    def _begin(self) -> None:
        self._work(self._run)

    def take(self) -> Frame:
        return self._show(self._pictures[self._last_frame_id % len(self._pictures)])

    def show(self, scene: int) -> Frame:
        """Publish the picture of the scene with this number; equal numbers show equal pictures."""
        pixels = np.random.default_rng(scene).integers(0, 256, (8, 8, 3), dtype=np.uint8)
        picture = pixels.repeat(_HEIGHT // 8, axis=0).repeat(_WIDTH // 8, axis=1)
        return self._show(picture.tobytes())

    def show_rubbish(self) -> Frame:
        return self._show(b"no picture")

    def break_down(self, sentence: str) -> None:
        """Stop delivering pictures, and report this fault."""
        self.is_frozen = True
        self._report_fault(sentence)

    def _run(self) -> None:
        next_s = self.clock.now_s()
        while not self.clock.wait(self._ending, max(0.0, next_s - self.clock.now_s())):
            next_s = max(next_s + 1 / self.rate_hz, self.clock.now_s())
            if not self.is_frozen:
                self.take()

    def _show(self, data: bytes) -> Frame:
        return self._publish(
            data,
            width=_WIDTH,
            height=_HEIGHT,
            encoding=self._encoding,
            captured_s=self.clock.now_s() - self.age_s,
        )


def _pattern(seed: int) -> bytes:
    """Return coloured blocks whose JPEG is about 5 KB."""
    # not a multiple of 8: the encoder's blocks would have one colour, and the file would be small
    block = 12
    shape = (_HEIGHT // block + 1, _WIDTH // block + 1, 3)
    blocks = np.random.default_rng(seed).integers(60, 200, shape, dtype=np.uint8)
    return blocks.repeat(block, axis=0).repeat(block, axis=1)[:_HEIGHT, :_WIDTH].tobytes()
