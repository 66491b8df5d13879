"""Recordings in the persistence of a robot's server."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robot.devices.rig import Rig
from robot.driver import describe
from robot.recordings.folder import NAME
from robot.recordings.queue import RecorderConfig
from robot.recordings.recorder import Recorder
from robot.recordings.rejoining import rejoin
from robot.recordings.store import EpisodeStore
from server.persistence import Persistence, PersistencePart


class Recordings(PersistencePart):
    """Records every run, and gives access to the recordings."""

    def __init__(self, kept: Persistence, rig: Rig) -> None:
        self.recorder = Recorder(
            rig.loop,
            kept.storage.folder(NAME),
            robot=kept.robot_name,
            declared_moves=describe(rig.driver.moves, rig.driver.declared_moves),
            options=kept.options,
            announce=kept.announce,
            config=RecorderConfig(keeps_drives=kept.settings.get("keep_drives", True)),
            disk=kept.disk,
        )
        self._storage = kept.storage
        self.episodes = EpisodeStore(kept.storage, recording=lambda: self.run)

    @property
    def run(self) -> str | None:  # type: ignore[override]
        """Id of the episode that is being recorded; None if none is."""
        return self.recorder.queue.episode_id

    def start(self) -> None:
        rejoin(self._storage)
        self.recorder.start()

    def stop(self) -> None:
        self.recorder.stop()

    def refuse(self, why: str) -> None:
        self.recorder.queue.refuse(f"Nothing is recorded: {why}")

    def resume(self) -> None:
        self.recorder.queue.resume()

    def end_run(self) -> None:
        self.recorder.begin_anew()

    def keep_run(self) -> None:
        self.recorder.keep()

    def write_result(self, of: str, fields: Mapping[str, Any]) -> None:
        self.recorder.write_result(of, dict(fields))
