"""A camera that shows YUYV pictures from a file, in place of a USB camera, for a brick without a
camera.

The camera is installed in the emulated brick like a third-party plugin, and reads one picture at a
time.
"""

from __future__ import annotations

import sys
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Self

from robot.camera import Camera
from robot.clock import Clock
from robot.driver import Driver
from robot.types import Encoding

WIDTH, HEIGHT = 160, 120
SIZE = 2 * WIDTH * HEIGHT
ENTRY_POINT = "[drivelesson.cameras]\nfilm = film_camera:FilmCamera\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmOptions:
    film: str = field(default="", metadata={"help": "file of YUYV pictures of 160x120"})
    frame_rate: float = field(default=10.0, metadata={"help": "pictures a second"})


class FilmCamera(Camera):
    name: ClassVar[str] = "film"
    options_type: ClassVar[type[Any]] = FilmOptions

    def __init__(self, options: FilmOptions, clock: Clock) -> None:
        super().__init__(clock)
        self._options = options
        self._shown = 0
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._play, daemon=True)

    @classmethod
    def for_driver(cls, driver: Driver, options: FilmOptions, clock: Clock) -> Self:
        return cls(options, clock)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._ending.set()

    def _play(self) -> None:
        with Path(self._options.film).open("rb") as film:
            while not self._ending.wait(1 / self._options.frame_rate):
                picture = film.read(SIZE)
                if len(picture) < SIZE:
                    film.seek(0)
                    self._say_what_is_imported()
                    continue
                self._publish(
                    picture,
                    width=WIDTH,
                    height=HEIGHT,
                    encoding=Encoding.YUYV,
                    captured_s=self.clock.now_s() - self._age_s(),
                )

    def _age_s(self) -> float:
        """Return the age of the next picture: one of six ages from 95 to 145 ms in turn, as on an
        EV3."""
        self._shown += 1
        return 0.095 + 0.05 * (self._shown % 6) / 5

    def _say_what_is_imported(self) -> None:
        """Write the imported modules of the serving process to a file, each time the film ends."""
        said = Path(self._options.film).with_suffix(".modules")
        said.with_suffix(".new").write_text("\n".join(_really_imported()))
        said.with_suffix(".new").rename(said)


def _really_imported() -> list[str]:
    """Return the imported modules without replaced ones and unused postponed ones."""
    return sorted(
        name
        for name, module in list(sys.modules.items())
        if type(module).__name__ != "_LazyModule" and getattr(module, "__spec__", None)
    )
