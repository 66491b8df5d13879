"""The simulated robot's camera; in real time its thread also advances the world."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any, ClassVar

from robot.clock import Clock
from robot.devices.encoders import jpeg_encoder
from robot.devices.options import Options, option
from robot.devkit.world_camera import WorldCamera
from robot.simulator.driver import SimDriver
from robot.simulator.renderer import HEIGHT_PX, LARGE_HEIGHT_PX, LARGE_WIDTH_PX, WIDTH_PX
from robot.types import Encoding, Frame

_LONGEST_GAP_S = 0.25
"""Longest step of the world after a pause, in seconds. The limit is low, so that the world hardly
jumps even after the machine was suspended."""

_USUAL_FRAMES = 10
"""The camera averages the shortest period over about this many pictures (an exponential moving
average)."""
_PER_TAKING, _PER_TAKING_S = 2, 0.1
_USUALLY_LATE_S, _PER_LATENESS, _LONGEST_PERIOD_S = 0.01, 8, 0.2
"""When the computer is busy, the camera takes fewer pictures. The shortest period between pictures
is the sum of two terms, but at most `_LONGEST_PERIOD_S`:

- `_PER_TAKING` times the time from when a picture is due until it is taken. This term is at most
  `_PER_TAKING_S`.
- `_PER_LATENESS` times the lateness in excess of `_USUALLY_LATE_S`. The lateness is the time from
  when a picture is due until the camera begins to take it.

`_USUALLY_LATE_S` is a lateness that is normal even if the computer is not busy: on some systems,
timers are 8 ms late on average. All robots on a computer are equally late, so all take the same
number of pictures. With this rule the lateness stays near 20 ms. Commands also stay fast, because
each thread that handles a command is delayed about as much as a picture."""
_RESTING_STEP_S = 1.0
"""Period at which the world advances while no picture is needed, in seconds."""
_EARLY_S = 0.01
_ASKED_FRAMES = 30
"""Number of frames for which large pictures are made after a large picture was requested."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SimCameraOptions(Options):
    """Options of the simulated camera."""

    frame_rate_hz: float = option(30.0, "pictures a second", range=(1.0, 120.0))
    jpeg_quality: int = option(75, "JPEG quality of simulated pictures", range=(1, 100))


class SimCamera(WorldCamera[SimDriver]):
    """Renders the simulated robot's view.

    In real time its pictures are JPEGs like a webcam's; a JPEG is encoded once, for the page, the
    recording and the learner. In experiments, which do not run in real time, `capture` takes each
    picture. `capture` returns raw pixels, so that the results do not depend on a codec.

    While somebody watches, a larger picture (320x240) is made with each JPEG; see `for_the_eye`.
    """

    name: ClassVar[str] = "sim"
    options_type: ClassVar[type[Any]] = SimCameraOptions
    body_type = SimDriver

    def __init__(self, body: SimDriver, options: SimCameraOptions, clock: Clock) -> None:
        super().__init__(body, options, clock)
        self._compress = jpeg_encoder(options.jpeg_quality, "the camera of a simulated world")
        self._period_s = 1.0 / options.frame_rate_hz
        self._every_s = 0.0
        self._stirred = threading.Event()
        self._asked_id = -_ASKED_FRAMES
        self._large: Frame | None = None

    def capture(self) -> Frame:
        """Take one picture now, on this thread, for experiments, which do not call `start`."""
        picture = self._body.simulation.render()
        return self._show(picture.tobytes(), Encoding.RGB, self.clock.now_s())

    def take_jpeg(self) -> Frame:
        """Take one picture now, on this thread, as a JPEG."""
        return self._take()

    def for_the_eye(self, frame: Frame) -> Frame:
        """Return the frame at 320x240. For the first request, the small frame is returned. While
        requests continue, the camera renders a large picture with each frame."""
        self._asked_id = frame.frame_id
        large = self._large
        return large if large is not None and large.frame_id == frame.frame_id else frame

    def _take(self) -> Frame:
        """Take one picture in the format of a webcam."""
        captured_s = self.clock.now_s()
        jpeg = self._compress(self._body.simulation.render())
        if self._last_frame_id - self._asked_id < _ASKED_FRAMES:
            data = self._compress(self._body.simulation.render_large())
            taken = Frame(
                frame_id=self._last_frame_id + 1,
                captured_s=captured_s,
                width=LARGE_WIDTH_PX,
                height=LARGE_HEIGHT_PX,
                encoding=Encoding.JPEG,
                data=data,
            )
            # Set the large picture before the frame is published: its listeners may request it.
            self._large = self.mounting.upright(taken)
        return self._show(jpeg, Encoding.JPEG, captured_s)

    def _show(self, data: bytes, encoding: Encoding, captured_s: float) -> Frame:
        return self._publish(
            data, width=WIDTH_PX, height=HEIGHT_PX, encoding=encoding, captured_s=captured_s
        )

    def _leave(self) -> None:
        self._body.simulation.close()

    def rest(self, every_s: float) -> None:
        self._every_s = every_s
        self._stirred.set()

    def _let_go(self) -> None:
        self._stirred.set()

    def _live(self) -> None:
        """Take pictures until the camera stops. If the computer simulates too many robots, each
        robot takes fewer pictures, so that commands and STOP are not late. At rest (see `rest`)
        the camera takes pictures less often, but the world advances at least once a second.
        """
        taken_s = last_s = self.clock.now_s()
        due_s, least_s = last_s + self._period_s, 0.0
        while True:
            self.clock.wait(self._stirred, max(0.0, due_s - self.clock.now_s()))
            self._stirred.clear()
            if self._ending.is_set():
                return
            now_s, every_s = self.clock.now_s(), self._every_s
            due_s = min(due_s, now_s)  # a rest may end before its next step is due
            self._body.advance(min(now_s - last_s, _LONGEST_GAP_S))
            last_s = now_s
            if every_s:
                if now_s >= taken_s + every_s - _EARLY_S:
                    self._take()
                    taken_s = now_s
                due_s = now_s + min(every_s, _RESTING_STEP_S)
                continue
            self._take()
            taken_s = now_s
            late_s = min(max(0.0, now_s - due_s), _LONGEST_PERIOD_S)
            wanted_s = min(_PER_TAKING * (self.clock.now_s() - now_s + late_s), _PER_TAKING_S)
            wanted_s += _PER_LATENESS * max(0.0, late_s - _USUALLY_LATE_S)
            least_s += (wanted_s - least_s) / _USUAL_FRAMES
            due_s = max(due_s + max(self._period_s, min(least_s, _LONGEST_PERIOD_S)), now_s)
