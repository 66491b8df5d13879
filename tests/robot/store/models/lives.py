"""Starts, teaches, edits and kills a robot on one data folder, and damages files, in virtual time.

`Lives` runs the real autosave, journal and store with the real loop, but without threads and
without waiting for the disk. `Lives` remembers the learner at each moment that must survive a kill.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO, ClassVar

import numpy as np

from robot.coaching.gallery import images
from robot.errors import RecordingError
from robot.learner.base import State
from robot.moves import Move, names
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.policy.undo import undo_edit, undo_examples
from robot.store.folder import Storage
from robot.store.models.autosave import Autosave
from robot.store.models.journal import _TRY_AGAIN_S, Journal
from robot.store.models.journal_writer import JournalWriter
from robot.store.models.model import same_nodes
from robot.store.models.recovery import newest_boot, recover
from robot.store.models.store import ModelStore
from robot.store.records import open_new
from robot.types import Action, Example, Point
from tests.robot.bench_robot import BenchRobot

MOVES = (Action.FORWARD, Action.LEFT, Action.RIGHT)


class Disk:
    """A disk that a test can fill."""

    is_full = False

    def check(self) -> None:
        if self.is_full:
            raise OSError(28, "No space left on device")

    def open(self, path: Path) -> BinaryIO:
        self.check()
        return _Refusing(open_new(path), self)


class _Refusing:
    def __init__(self, file: BinaryIO, disk: Disk) -> None:
        self._file, self._disk = file, disk

    def write(self, data: Any) -> int:
        self._disk.check()
        return self._file.write(data)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


class DiskStore(ModelStore):
    """A store on a disk that a test can fill up, with a wall clock that a test can set to any
    time."""

    def __init__(self, storage: Storage, disk: Disk, wall_s: list[float]) -> None:
        super().__init__(storage, wall_s=lambda: wall_s[0])
        self._disk = disk

    def save(self, name: str, model: Any) -> Path:
        self._disk.check()
        return super().save(name, model)


class Life(BenchRobot):
    """One start of the program."""

    all: ClassVar[list[Life]] = []

    def __init__(
        self,
        folder: Path,
        wall_s: list[float],
        rng: random.Random,
        learner: str = "published-4",
        *,
        writes: bool = True,
        declared: tuple[Move, ...] = (),
    ) -> None:
        super().__init__(make_policy(learner, names(declared)) if declared else learner)
        self.loop.history.declared = declared
        self.policy.kinds.describe(declared)
        self._dim = 1200 if learner.startswith("published") else 1584
        Life.all.append(self)
        self.rng, self.disk = rng, Disk()
        storage = Storage(folder)
        self.store = DiskStore(storage, self.disk, wall_s)
        self.journal = Journal()
        self.writer = JournalWriter(self.journal, storage.journal, open_file=self.disk.open)
        self.autosave = Autosave(self.loop, self.store, self.journal, moves=self.policy.moves)
        queue = self.loop.submit

        def submit(request: Any) -> Future[Any]:
            future = queue(request)
            self.tick()
            return future

        self.loop.submit = submit
        recovered = recover(storage.journal, self.store, declared)
        self.recovered = recovered is not None
        self.writer.open_boot(newest_boot(self.store))
        self.autosave.start()
        if recovered:
            self.autosave.adopt(recovered)
        self.autosave.load_last()
        self.frame = 0
        # `durable` has the states that the next start may find after a kill: the newest written
        # state, and later ones. `journalled` has only the journal's states, because a model's
        # file may be damaged.
        self.durable, self.journalled = [self.state()], [self.state()]
        if writes:
            self.write()

    @property
    def policy(self) -> Policy:
        return self.loop.history.policy

    def state(self) -> State:
        return self.policy.get_state()

    # A person's actions --------------------------------------------------------------------------

    def teach(self, examples: int | None = None) -> None:
        """Teach this number of examples, or one to five."""
        history = self.loop.history
        for _ in range(examples or self.rng.randrange(1, 6)):
            self.frame += 1
            dice = np.random.default_rng(self.rng.getrandbits(32))
            x = dice.integers(0, 256, self._dim).astype(np.uint8)
            label = self.rng.choice(self.policy.moves)
            point = Point(math.sin(self.frame), 0.5) if self.frame % 3 == 0 else None
            example = Example(frame_id=self.frame, label=label, is_intervention=False, point=point)
            self.clock.advance(0.2)
            now_s = self.clock.now_s()
            self.loop.submit(lambda e=example, v=x, s=now_s: history.teach(e, v, s)).result(0)
        self._changed()

    def _do(self, change: Callable[[], object]) -> None:
        self.loop.submit(change).result(0)
        self._changed()

    def undo(self) -> None:
        self._do(lambda: undo_examples(self.loop.history, self.rng.uniform(0.2, 3.0)))

    def edit(self) -> None:
        verb = self.rng.choice(("relabel", "pin", "delete"))
        if nodes := [image.node_id for image in images(self.policy)]:
            value = self.rng.choice(MOVES) if verb == "relabel" else self.rng.random() < 0.5
            node = self.rng.choice(nodes)
            with suppress(ValueError):
                self._do(lambda: self.loop.history.edit(verb, node, value))

    def undo_edit(self) -> None:
        self._do(lambda: undo_edit(self.loop.history))

    def drive(self) -> None:
        """End a drive; at the beginning of the next drive, some learners look for their place."""
        self._do(self.loop.history.begin_drive)

    def save(self) -> None:
        had_unsaved = self.autosave.has_unsaved
        self.autosave.save_if_changed()
        if had_unsaved and not self.disk.is_full:
            self.durable = [self.state()]

    def begin(self) -> None:
        self._switch(self.autosave.begin)

    def load(self) -> None:
        if names := self.store.names():
            self._switch(lambda: self.autosave.load(self.rng.choice(names)))

    def _switch(self, switch: Any) -> None:
        """Change the model. A change that is refused must not have changed anything."""
        before = self.state()
        had_unsaved = self.autosave.has_unsaved
        try:
            switch()
        except (OSError, RecordingError) as error:
            assert self.disk.is_full or isinstance(error, RecordingError)
            assert same(before, self.state())
            assert self.autosave.has_unsaved == had_unsaved or isinstance(error, RecordingError)
        else:
            assert not (self.disk.is_full and had_unsaved)
            self._changed()

    def free_disk(self) -> None:
        self.disk.is_full = False
        self.clock.advance(_TRY_AGAIN_S + 0.1)
        self.tick()
        self.write()

    def write(self) -> None:
        """Let the journal's thread write; from now on, all earlier changes must survive."""
        self.writer.write_waiting()
        if self.writer.fault is None and not self.journal._needs_checkpoint:
            self.durable, self.journalled = [self.state()], [self.state()]

    def _changed(self) -> None:
        self.durable.append(self.state())
        self.journalled.append(self.state())

    def die(self) -> None:
        """Kill the program, so that all data that is only in memory is lost."""
        self.journal._queue.clear()
        self.writer.stop()


def same(a: State, b: State) -> bool:
    return same_nodes(a, b) and a.params["learner"] == b.params["learner"]
