"""Recorded footage as a camera: its frames at their own pace, their JPEG bytes untouched."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar, Protocol

from numpy.typing import NDArray

from robot.clock import Clock
from robot.devices.options import Options, option
from robot.devices.watched_camera import ThreadedCamera
from robot.errors import ConfigurationError, RecordingError
from robot.exchange.npz import Recording, load_recording
from robot.types import Frame

_LONGEST_PAUSE_S = 0.15
"""A pause in the footage is cut to this: the loop's own patience with a frame is 0.2 s."""
_LAST_FRAME_S = 0.05
"""How long the last frame of a recording is shown before the next recording begins."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayCameraOptions(Options):
    """What is played."""

    recording: str = option("", "a recording (.npz), or a folder whose recordings are played")
    episode: str = option("", "a recorded run (.mcap) to play instead")
    loop: bool = option(True, "yes: begin again at the end; no: stop")


class Footage(Protocol):
    """Pictures in order, and the seconds at which each was taken."""

    @property
    def t_s(self) -> NDArray[Any]:
        """Seconds, ascending, shape (pictures,)."""

    def frame(self, index: int) -> Frame:
        """Read one picture."""


class ReplayCamera(ThreadedCamera):
    """Plays one recording, or a folder's in the order of their names.

    Raises:
        ConfigurationError: If no recording was chosen, or the folder has none.
        RecordingError: By `start`, if a recording is missing or broken.
    """

    name: ClassVar[str] = "replay"
    options_type: ClassVar[type[Any]] = ReplayCameraOptions

    def __init__(self, options: ReplayCameraOptions, clock: Clock) -> None:
        super().__init__(options, clock)
        if bool(options.recording) == bool(options.episode):
            raise ConfigurationError(
                "the camera 'replay' needs --recording, a file or a folder, or else --episode FILE"
            )
        self._path = Path(options.recording or options.episode).expanduser()
        self._is_episode = bool(options.episode)
        self._loops = options.loop

    def _begin(self) -> None:
        """Read the footage and begin to play it."""
        recordings: Sequence[Footage] = (
            [_load_episode(self._path)] if self._is_episode else load_footage(self._path)
        )
        self._work(lambda: self._play(recordings))

    def _play(self, recordings: Sequence[Footage]) -> None:
        try:
            self._play_all(recordings)
        except (RecordingError, OSError) as error:
            self._report_fault(f"The recording cannot be played on: {error}")

    def _play_all(self, recordings: Sequence[Footage]) -> None:
        due_s = self.clock.now_s()
        while True:
            for frame, shown_s in _timed_frames(recordings):
                if self.clock.wait(self._ending, max(0.0, due_s - self.clock.now_s())):
                    return
                self._show(frame)
                due_s = max(due_s, self.clock.now_s() - _LONGEST_PAUSE_S) + shown_s
            if not self._loops:
                self.clock.wait(self._ending, max(0.0, due_s - self.clock.now_s()))
                self._report_fault(f"The recording {self._path} is over.")
                return

    def _show(self, frame: Frame) -> None:
        self._publish(
            frame.data,
            width=frame.width,
            height=frame.height,
            encoding=frame.encoding,
            captured_s=self.clock.now_s(),
        )


def _load_episode(path: Path) -> Footage:
    from robot.exchange.footage import EpisodeFootage

    return EpisodeFootage(path)


def load_footage(path: Path) -> list[Recording]:
    """Load a recording, or all recordings of a folder in the order of their names.

    Raises:
        ConfigurationError: If the folder has none.
        RecordingError: If one is missing or broken.
    """
    if not path.is_dir():
        return [load_recording(path)]
    try:
        paths = sorted(path.glob("*.npz"))
    except OSError as error:
        raise RecordingError(f"cannot read the folder {path}: {error}") from error
    if not paths:
        raise ConfigurationError(f"the folder {path} has no recordings (.npz)")
    return [load_recording(each) for each in paths]


def _timed_frames(recordings: Sequence[Footage]) -> Iterator[tuple[Frame, float]]:
    """Yield each frame and how long it is shown."""
    for recording in recordings:
        times_s = [float(t) for t in recording.t_s]
        times_s.append(times_s[-1] + _LAST_FRAME_S)
        for index, (begin_s, end_s) in enumerate(pairwise(times_s)):
            yield recording.frame(index), min(max(end_s - begin_s, 0.0), _LONGEST_PAUSE_S)
