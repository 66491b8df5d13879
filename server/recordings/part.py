"""Connects the recorder and the store of recordings with the server's `Persistence`."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from typing import Any, BinaryIO

from robot.devices.rig import Rig
from robot.moves import describe
from robot.recordings.archive import copy_edited
from robot.recordings.config import RecorderConfig
from robot.recordings.editing import write_edited
from robot.recordings.edits import Notes
from robot.recordings.episode import Episode
from robot.recordings.folder import NAME
from robot.recordings.recorder import Recorder
from robot.recordings.rejoining import rejoin
from robot.recordings.store import EpisodeStore
from server.persistence import Persistence, PersistencePart
from server.recordings.separate_process import SeparateWork

_SHORT = 5000
"""Recordings of up to this many pictures are copied in this process; for longer recordings, a
separate process is faster."""


class Recordings(PersistencePart):
    """Records every run, and gives access to the recordings."""

    def __init__(self, kept: Persistence, rig: Rig) -> None:
        self.recorder = Recorder(
            rig.loop,
            kept.storage.folder(NAME),
            robot=kept.robot_name,
            declared_moves=describe(rig.driver.moves, rig.driver.declared_moves),
            options=kept.options,
            announce=self._announce,
            config=RecorderConfig(keeps_drives=kept.settings.get("keep_drives", True)),
            disk=kept.disk,
        )
        self._kept = kept
        recording = self.recorder.recording
        self.episodes = EpisodeStore(
            kept.storage, lambda: recording.episode_id, _write_edited, rig.clock.wall_s
        )

    def _announce(self, name: str, **fields: Any) -> None:
        """Announce an event of the recorder. First set `run` to the name of the current recording,
        because recording may just have begun or ended."""
        self._kept.run = self.recorder.recording.episode_id
        self._kept.announce(name, **fields)

    def start(self) -> None:
        self.episodes.remove_old_trash()
        rejoin(self._kept.storage)
        self.recorder.start()

    def stop(self) -> None:
        self.recorder.stop()

    def refuse(self, why: str) -> None:
        self.recorder.recording.refuse(f"Nothing is recorded: {why}")

    def resume(self) -> None:
        self.recorder.recording.fault = None

    def end_run(self) -> None:
        self.recorder.begin_anew()

    def keep_run(self) -> None:
        self.recorder.keep()

    def write_result(self, of: str, fields: Mapping[str, Any]) -> None:
        self.recorder.write_result(of, dict(fields))


def _write_edited(episode: Episode, notes: Notes, file: BinaryIO, *, is_part: bool = False) -> None:
    """Write an edited recording (see `write_edited`). A separate process edits a long recording."""
    if len(episode.frames) <= _SHORT:
        write_edited(episode, notes, file, is_part=is_part)
        return
    with contextlib.closing(SeparateWork(copy_edited, episode.path, notes, is_part)) as blocks:
        for block in blocks:
            file.write(block)
