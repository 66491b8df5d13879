"""What the server saves for one robot: models, and the recordings of its runs."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Mapping
from typing import Any

from robot.devices.rig import Rig
from robot.driver import describe
from robot.errors import ConfigurationError, InUseError, RobotError
from robot.recordings.queue import RecorderConfig
from robot.recordings.recorder import Recorder
from robot.recordings.store import EpisodeStore
from robot.store.disk import Announce, DiskThread, no_announcement
from robot.store.folder import Storage
from robot.store.lock import FolderLock
from robot.store.models.autosave import Autosave
from robot.store.models.journal import Journal
from robot.store.models.replay import newest_boot, recover
from robot.store.models.store import ModelStore
from robot.store.models.trial import try_model
from robot.store.presence import Presence
from robot.types import StartStop

log = logging.getLogger(__name__)


class Persistence(StartStop):
    """Starts and stops autosave and recorder, unless the storage has a `fault`."""

    def __init__(
        self,
        storage: Storage,
        rig: Rig,
        *,
        name: str = "robot",
        options: Mapping[str, Any] | None = None,
        announce: Announce = no_announcement,
        keeps_drives: bool = True,
    ) -> None:
        self.storage = storage
        self._announce = announce
        self._lock = FolderLock(storage.root)
        self._loop = rig.loop
        self._noted_failure: str | None = None
        self._presence: Presence | None = None
        self._is_gone = False
        self.models = ModelStore(storage, rig.clock.wall_s, announce)
        self.journal = Journal(storage.journal, announce, clock=rig.clock)
        self.autosave = Autosave(
            rig.loop,
            self.models,
            self.journal,
            name=name,
            moves=rig.driver.moves,
            announce=announce,
        )
        self._disk = DiskThread(rig.clock)
        self._disk.add(self._watch_folder)
        self._disk.add(self.journal.sync)
        self._disk.add(self.autosave.save_if_due)
        self._disk.add(self._note_failure)
        self.recorder = Recorder(
            rig.loop,
            storage.episodes,
            robot=name,
            declared_moves=describe(rig.driver.moves, rig.driver.declared_moves),
            options=options,
            announce=announce,
            config=RecorderConfig(keeps_drives=keeps_drives),
            disk=self._disk,
        )
        self.episodes = EpisodeStore(storage, recording=lambda: self.recording)

    @property
    def recording(self) -> str | None:
        """Id of the episode that is being recorded, if any is."""
        return self.recorder.queue.episode_id

    def start(self) -> None:
        """Lock the folder, recover from a power cut, and start saving and recording.

        `autosave.load_last` loads the last model. Where nothing can be saved, this only reports
        it, and the robot drives. ConfigurationError if another program uses the folder.
        """
        if self.storage.fault is not None:
            self.recorder.queue.refuse(f"Nothing is recorded: {self.storage.fault}")
            return
        try:
            self._lock.start()
        except InUseError:
            raise
        except ConfigurationError as error:
            log.warning("the data folder is not locked: %s", error)
        with contextlib.suppress(OSError):  # a folder that takes nothing is not missed
            self._presence = Presence(self.storage.root)
            self._presence.watch()
        self.storage.sweep()
        self.journal.start(after=newest_boot(self.models))
        self.autosave.start()
        self.recorder.start()
        self._disk.start()
        try:
            self._recover()
        except Exception as error:  # the robot starts, whatever the files contain
            log.exception("nothing was recovered from the journal")
            self._announce("model_not_saved", detail=str(error))

    def _recover(self) -> None:
        if self.models.set_failed_aside():
            return  # what failed would only come back
        recovered = recover(self.storage.journal, self.models, self._loop.history.declared)
        if recovered is not None:
            try_model(recovered.model)
            self.autosave.adopt(recovered)

    def _watch_folder(self) -> None:
        """Announce that the data folder is gone, or back: then what was learned is saved."""
        is_gone = self._presence is not None and not self._presence.is_there()
        if is_gone == self._is_gone:
            return
        self._is_gone = is_gone
        if is_gone:
            why = f"{self.storage.root}: the data folder is gone; was its disk pulled out?"
            log.warning("nothing is saved: %s", why)
            self._announce("nothing_kept", detail=why)
        else:
            log.info("the data folder is back")
            self.recorder.queue.resume()
            self._announce("kept_again")
            self.autosave.save_if_changed()

    def _note_failure(self) -> None:
        """Write down that the learner in use failed, so that the next start sets it aside."""
        why, name = self._loop.learning.failure, self.autosave.name
        if why is not None and why != self._noted_failure and name is not None:
            with contextlib.suppress(OSError, RobotError):  # the next turn tries again
                self.models.note_failure(name, why)
                self._noted_failure = why

    def stop(self) -> None:
        """Finish the recording and save the model; the loop must still run. Idempotent."""
        self.recorder.stop()
        self._disk.stop()
        self.autosave.stop()
        self.journal.stop()
        if self._presence is not None:
            self._presence.end_watch()
        self._lock.stop()
