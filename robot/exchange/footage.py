"""An episode as footage: its pictures in order, for a camera that replays them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robot.errors import RecordingError
from robot.store.episodes.edits import read_notes
from robot.store.episodes.episode import open_episode
from robot.types import Frame


class EpisodeFootage:
    """The pictures that were not deleted. `t_s` are seconds, ascending; pictures are read lazily.

    Raises:
        RecordingError: If the file is missing, no episode, or has no pictures.
    """

    def __init__(self, path: Path) -> None:
        try:
            self._episode = open_episode(path)
            notes = read_notes(path)
        except OSError as error:
            raise RecordingError(f"there is no episode {path}: {error.strerror}") from error
        frames = self._episode.frames.values()
        entries = [entry for entry in frames if not notes.is_deleted(entry.frame_id)]
        if not entries:
            raise RecordingError(f"the episode {path} has no pictures")
        self._ids = [entry.frame_id for entry in entries]
        times_s = np.array([entry.captured_s for entry in entries])
        self.t_s: NDArray[np.float64] = times_s - times_s[0]

    def __len__(self) -> int:
        return len(self._ids)

    def frame(self, index: int) -> Frame:
        """Read one picture."""
        return self._episode.frame(self._ids[index])
