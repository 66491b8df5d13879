"""Saves the models of a robot. Extensions save more about each run, for example recordings.

An extension adds a `PersistencePart` by an entry point of `drivelesson.persistence`.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Mapping
from typing import Any, TypeVar, cast

from robot.devices.rig import Rig
from robot.entry_points import points
from robot.errors import ConfigurationError, InUseError, RobotError, reason
from robot.store.disk import Announce, DiskThread, no_announcement
from robot.store.folder import Storage
from robot.store.lock import FolderLock
from robot.store.models.autosave import Autosave
from robot.store.models.journal import Journal
from robot.store.models.journal_writer import JournalWriter
from robot.store.models.recovery import newest_boot, recover
from robot.store.models.store import ModelStore
from robot.store.models.trial import try_model
from robot.store.presence import Presence
from robot.types import StartStop

log = logging.getLogger(__name__)
PARTS = "drivelesson.persistence"
_P = TypeVar("_P", bound="PersistencePart")


class PersistencePart(StartStop):
    """An extension's part that saves data of a robot's runs, for example as a recording."""

    def __init__(self, kept: Persistence, rig: Rig) -> None: ...

    def refuse(self, why: str) -> None:
        """Stop saving, because the data folder cannot be used."""

    def resume(self) -> None:
        """Resume saving, because the data folder is back."""

    def end_run(self) -> None:
        """End the run, because the robot's setup changes. Only the loop's thread may call it."""

    def keep_run(self) -> None:
        """Save the current run, even if nobody teaches during it."""

    def write_result(self, of: str, fields: Mapping[str, Any]) -> None:
        """Add a result to the current run. Only the loop's thread may call it."""


class Persistence(StartStop):
    """Starts and stops autosave and the extensions' parts, unless the storage has a `fault`.

    Attributes:
        run: The name of the run that a part is saving; None while none is being saved.

    Args:
        name: The robot's name, which new models get.
        options: The options with which the robot was started, saved with each run.
        settings: Options of `drivelesson serve`, for the extensions' parts.
    """

    def __init__(
        self,
        storage: Storage,
        rig: Rig,
        *,
        name: str = "robot",
        options: Mapping[str, Any] | None = None,
        announce: Announce = no_announcement,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        self.storage = storage
        self.run: str | None = None
        self.robot_name, self.settings = name, settings or {}
        self.options = dict(options or {})
        self.announce = announce
        self._lock = FolderLock(storage.root)
        self._loop = rig.loop
        self._noted_failure: str | None = None
        self._presence: Presence | None = None
        self._is_gone = False
        self.models = ModelStore(storage, rig.clock.wall_s, announce)
        self.journal = Journal()
        self.writer = JournalWriter(self.journal, storage.journal, announce, clock=rig.clock)
        self.autosave = Autosave(
            rig.loop,
            self.models,
            self.journal,
            name=name,
            moves=rig.driver.moves,
            announce=announce,
        )
        self.disk = DiskThread(rig.clock)
        self.disk.add(self._watch_folder)
        self.disk.add(self.writer.sync)
        self.disk.add(self.autosave.save_if_due)
        self.disk.add(self._note_failure)
        kinds: list[type[PersistencePart]] = [point.load() for point in points(PARTS)]
        self._parts = {kind: kind(self, rig) for kind in kinds}

    def part(self, kind: type[_P]) -> _P:
        """Return an extension's part; raises KeyError if the extension is not installed."""
        return cast(_P, self._parts[kind])

    def keep_run(self) -> None:
        """Have every part save the current run, even if nothing is taught in it."""
        for part in self._parts.values():
            part.keep_run()

    def note_options(self, options: Mapping[str, Any]) -> None:
        """End the run; save `options` with all later runs. Only the loop's thread may call it."""
        self.options.update({name: str(value) for name, value in options.items()})
        for part in self._parts.values():
            part.end_run()

    def write_result(self, of: str, fields: Mapping[str, Any]) -> None:
        """Add a result of the kind `of` to the run. Only the loop's thread may call it."""
        for part in self._parts.values():
            part.write_result(of, fields)

    def start(self) -> None:
        """Lock the data folder, recover what a power cut has interrupted, and start saving.

        If nothing can be saved, the fault is only reported, and the robot drives nevertheless.
        Raises ConfigurationError if another program uses the folder.
        """
        if self.storage.fault is not None:
            for part in self._parts.values():
                part.refuse(self.storage.fault)
            return
        try:
            self._lock.start()
        except InUseError:
            raise
        except ConfigurationError as error:
            log.warning("cannot lock the data folder: %s", error)
        with contextlib.suppress(OSError):  # a read-only data folder cannot be watched
            self._presence = Presence(self.storage.root)
            self._presence.watch()
        self.storage.sweep()
        self.writer.start(after=newest_boot(self.models))
        self.autosave.start()
        for part in self._parts.values():
            part.start()
        self.disk.start()
        try:
            self._recover()
        except Exception as error:  # the robot starts despite damaged files
            log.exception("nothing was recovered from the journal")
            self.announce("model_not_saved", detail=reason(error))

    def _recover(self) -> None:
        self.models.retry_damaged()
        if self.models.set_failed_aside():
            return  # otherwise the journal would restore the model whose learner has failed
        recovered = recover(self.storage.journal, self.models, self._loop.history.declared)
        if recovered is not None:
            try_model(recovered.model)
            self.autosave.adopt(recovered)

    def _watch_folder(self) -> None:
        """Announce when the data folder is gone or back; save the model when it is back."""
        is_gone = self._presence is not None and not self._presence.is_there()
        if is_gone == self._is_gone:
            return
        self._is_gone = is_gone
        if is_gone:
            why = f"{self.storage.root}: the data folder is gone; was its disk unplugged?"
            log.warning("nothing is saved: %s", why)
            self.announce("nothing_kept", detail=why)
        else:
            log.info("the data folder is back")
            for part in self._parts.values():
                part.resume()
            self.announce("kept_again")
            self.autosave.save_if_changed()

    def _note_failure(self) -> None:
        """Record that the learner in use failed, so that the next start sets it aside."""
        why, name = self._loop.learning.failure, self.autosave.name
        if why is not None and why != self._noted_failure and name is not None:
            with contextlib.suppress(OSError, RobotError):  # the next check of the disk tries again
                self.models.note_failure(name, why)
                self._noted_failure = why

    def stop(self) -> None:
        """Finish saving; the loop must still run. Idempotent."""
        for part in self._parts.values():
            part.stop()
        self.disk.stop()
        self.autosave.stop()
        self.writer.stop()
        if self._presence is not None:
            self._presence.end_watch()
        self._lock.stop()
