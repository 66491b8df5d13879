"""A camera that replays recorded footage at its original pace, with unchanged JPEG bytes."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from robot.clock import Clock
from robot.devices.options import Options, option
from robot.devkit.pictures import Picture
from robot.devkit.threaded_camera import ThreadedCamera
from robot.errors import ConfigurationError, RecordingError, told_as
from robot.exchange.files import files_ending
from robot.exchange.npz import load_recording
from robot.exchange.timeline import make_timeline
from robot.types import Frame

_LONGEST_PAUSE_S = 0.15
"""Longest pause between two pictures that is replayed, in seconds. After 0.2 s the loop would stop
the robot for lack of a frame."""
_LAST_FRAME_S = 0.05
"""Time for which the last frame of a recording is shown before the next recording begins, in
seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayCameraOptions(Options):
    """The footage to play."""

    recording: str = option("", "a recording (.npz), or a folder whose recordings are played")
    episode: str = option("", "a recorded run (.mcap) to play instead")
    loop: bool = option(True, "at the end, begin again (yes) or stop (no)")


Footage = list[tuple[float, Callable[[], Picture | Frame]]]
"""The times of the pictures in seconds, ascending, each with the function that reads the
picture."""


class ReplayCamera(ThreadedCamera):
    """Plays one recording, or a folder's recordings in the order of their names. Raises an error if
    there is no recording."""

    name: ClassVar[str] = "replay"
    options_type: ClassVar[type[Any]] = ReplayCameraOptions
    can_be_turned: ClassVar[bool] = False

    def __init__(self, options: ReplayCameraOptions, clock: Clock) -> None:
        super().__init__(options, clock)
        if bool(options.recording) == bool(options.episode):
            raise ConfigurationError(
                "the camera 'replay' needs --recording with a file or a folder, or --episode with "
                "a file"
            )
        self._path = Path(options.recording or options.episode).expanduser()

    def _begin(self) -> None:
        load = _load_episode if self.options.episode else _load_recordings
        shown = [pair for footage in load(self._path) for pair in _timed(footage)]
        self._work(partial(self._play, shown))

    def _play(self, shown: list[tuple[Callable[[], Picture | Frame], float]]) -> None:
        try:
            due_s = self.clock.now_s()
            for read, shown_s in itertools.cycle(shown) if self.options.loop else shown:
                frame = read()
                if self._waits_until(due_s):
                    return
                self._show_picture(frame, self.clock.now_s())
                due_s = max(due_s, self.clock.now_s() - _LONGEST_PAUSE_S) + shown_s
            self._waits_until(due_s)
            self._report_fault(f"The recording {self._path} has ended.")
        except (RecordingError, OSError) as error:
            self._report_fault(f"The rest of the recording cannot be played: {error}")

    def _waits_until(self, due_s: float) -> bool:
        """Wait until `due_s`; return True if the camera was stopped meanwhile."""
        return self.clock.wait(self._ending, max(0.0, due_s - self.clock.now_s()))


def _load_episode(path: Path) -> list[Footage]:
    """Open an episode without its deleted frames."""
    from robot.recordings.edits import read_notes
    from robot.recordings.episode import open_episode

    with told_as(RecordingError, f"there is no episode {path}"):
        episode, notes = open_episode(path), read_notes(path)
    is_kept = ~notes.deleted(episode.frames.ids)
    if not is_kept.any():
        raise RecordingError(f"the episode {path} has no pictures")
    ids, times_s = episode.frames.ids[is_kept].tolist(), episode.frames.captured_s[is_kept]
    return [[(s, partial(episode.frame, i)) for s, i in zip(times_s.tolist(), ids, strict=True)]]


def _load_recordings(path: Path) -> list[Footage]:
    """Load a recording, or all recordings of a folder, sorted by name."""
    with told_as(RecordingError, f"cannot read the folder {path}"):
        paths = files_ending(path, ".npz") if path.is_dir() else [path]
    if not paths:
        raise ConfigurationError(f"the folder {path} has no recordings (.npz)")
    found: list[Footage] = []
    for shots in (load_recording(each).shots for each in paths):
        times_s = make_timeline([shot.t_s for shot in shots]).times_s
        found.append(list(zip(times_s, (shot.picture for shot in shots), strict=True)))
    return found


def _timed(footage: Footage) -> Iterator[tuple[Callable[[], Picture | Frame], float]]:
    """For each picture, yield the function that reads it, and how long to show it, in seconds."""
    ends_s = [t_s for t_s, _ in footage[1:]] + [footage[-1][0] + _LAST_FRAME_S]
    for (begin_s, read), end_s in zip(footage, ends_s, strict=True):
        yield read, min(max(end_s - begin_s, 0.0), _LONGEST_PAUSE_S)
