"""A camera of moving YUYV pictures, like a USB camera, for an emulated brick without one.

`armel.py` installs it in the brick like a third-party plugin. It imports nothing that the server
postpones, such as numpy's random numbers.
"""

from __future__ import annotations

import itertools
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from robot.devkit.threaded_camera import ThreadedCamera
from robot.types import Encoding

WIDTH, HEIGHT, STEP, N_PICTURES = 160, 120, 6, 100
SIZE = 2 * WIDTH * HEIGHT
ENTRY_POINT = "[drivelesson.cameras]\nfilm = film_camera:FilmCamera\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmOptions:
    frame_rate: float = field(default=10.0, metadata={"help": "pictures a second"})


class FilmCamera(ThreadedCamera):
    name: ClassVar[str] = "film"
    options_type: ClassVar[type[Any]] = FilmOptions

    def _begin(self) -> None:
        self._work(self._play)

    def _play(self) -> None:
        scene = make_scene()
        for index in itertools.count():
            if self._ending.wait(1 / self.options.frame_rate):
                return
            at = index % N_PICTURES * STEP
            age_s = 0.095 + 0.05 * (index % 6) / 5  # as on an EV3
            self._publish(
                scene[:, at : at + WIDTH].tobytes(),
                width=WIDTH,
                height=HEIGHT,
                encoding=Encoding.YUYV,
                captured_s=self.clock.now_s() - age_s,
            )
            if at == 0:
                _say_what_is_imported()


def make_scene() -> np.ndarray[Any, np.dtype[np.uint8]]:
    """Return a wide view of blocks, shape (HEIGHT, width, 2), as YUYV."""
    width = WIDTH + N_PICTURES * STEP
    blocks = np.arange(HEIGHT // 6 * (width // 8)).reshape(HEIGHT // 6, -1) * 40503 % 65521 % 256
    scene = np.full((HEIGHT, width, 2), 128, np.uint8)
    scene[:, :, 0] = blocks.repeat(6, axis=0).repeat(8, axis=1)
    return scene


def _say_what_is_imported() -> None:
    """Report the modules of the serving process, except replaced modules, and postponed modules
    that were never used."""
    names = sorted(
        name
        for name, module in list(sys.modules.items())
        if type(module).__name__ != "_LazyModule" and getattr(module, "__spec__", None)
    )
    said = Path(__file__).with_name("film.modules")
    said.with_suffix(".new").write_text("\n".join(names))
    said.with_suffix(".new").rename(said)
