"""What the server keeps on disk, joined to one robot: models, and the recordings of its runs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robot.episodes.recorder import Recorder
from robot.episodes.recovery import recover_last
from robot.episodes.store import EpisodeStore
from robot.lifecycle import StartStop
from robot.models.autosave import Announce, Autosave, say_nothing
from robot.models.store import ModelStore
from robot.moves import describe
from robot.rig.rig import Rig
from robot.storage.folder import Storage
from robot.storage.lock import FolderLock


class Persistence(StartStop):
    """Starts and stops what keeps. A context manager, inside of the rig's."""

    def __init__(
        self,
        storage: Storage,
        rig: Rig,
        *,
        name: str = "robot",
        options: Mapping[str, Any] | None = None,
        announce: Announce = say_nothing,
    ) -> None:
        self.storage = storage
        self._name = name
        self._lock = FolderLock(storage.root)
        self.models = ModelStore(storage)
        self.autosave = Autosave(
            rig.loop, self.models, name=name, moves=rig.driver.moves, announce=announce
        )
        self.recorder = Recorder(
            rig.loop,
            storage.episodes,
            robot=name,
            declared_moves=describe(rig.driver.moves, rig.driver.declared_moves),
            options=options,
            announce=announce,
        )
        self.episodes = EpisodeStore(storage, recording=lambda: self.recording)

    @property
    def recording(self) -> str | None:
        """Id of the episode that is being recorded, if any is."""
        return self.recorder.episode_id

    def start(self) -> None:
        """Take the folder, recover from a power cut, and begin to keep.

        What was kept before is loaded by `autosave.load_last`.

        Raises:
            ConfigurationError: If another program keeps its lessons there.
        """
        self._lock.start()
        self.storage.sweep()
        recover_last(self.storage.episodes, self.models, self._name)
        self.autosave.start()
        self.recorder.start()

    def stop(self) -> None:
        """Finish the recording and save what was learned; the loop must still turn. Idempotent."""
        self.recorder.stop()
        self.autosave.stop()
        self._lock.stop()
