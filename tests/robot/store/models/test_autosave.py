"""Everything learned is saved automatically, up to the very last tick."""

from __future__ import annotations

import errno
import os
import threading
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path

import pytest

from robot.control.state import Tick
from robot.policy.undo import undo_examples
from robot.store.folder import Storage
from robot.store.models.autosave import Autosave
from robot.store.models.journal import Journal
from robot.types import Action, Example
from tests.robot.bench_robot import BenchRobot

from .lives import Disk, DiskStore


class KeptRobot(BenchRobot):
    """A robot whose loop ticks on its own thread, with autosave on a disk that can be full."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        storage, self.disk = Storage(folder), Disk()
        self.store, self.told = DiskStore(storage, self.disk, [0.0]), list[str]()
        self.autosave = Autosave(
            self.loop,
            self.store,
            Journal(),
            announce=lambda name, **fields: self.told.append(str(fields.get("detail", name))),
        )
        self.autosave.start()

    def teach(self, scene: int) -> Future[None]:
        frame = self.camera.show(scene)

        def teach() -> None:
            history = self.loop.history
            example = Example(frame_id=frame.frame_id, label=Action.LEFT, is_intervention=False)
            history.teach(example, history.policy.extract(frame), frame.captured_s)

        return self.loop.submit(teach)

    def teach_now(self, scene: int) -> None:
        self.clock.result(self.teach(scene), 5)

    def kept_lessons(self) -> list[int]:
        return [model.summary.n_examples for _, model in self.store.good_models()]


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[KeptRobot]:
    robot = KeptRobot(tmp_path)
    robot.rig.start()
    yield robot
    robot.autosave.stop()
    robot.rig.stop()


def test_examples_of_the_current_tick_are_saved(robot: KeptRobot) -> None:
    """Autosave is stopped before the loop has reported the tick that taught."""
    taught, go_on = threading.Event(), threading.Event()

    def hold_up(tick: Tick) -> None:
        if tick.history_events:
            taught.set()
            robot.clock.wait(go_on, 5)

    robot.loop.subscribe(hold_up)
    listeners = robot.loop._cycle.listeners
    n_listeners = len(listeners)
    robot.teach(1)
    assert robot.clock.wait(taught, 5) and robot.autosave.has_unsaved
    ending = robot.clock.start_thread(robot.autosave.stop, "ending")
    while len(listeners) == n_listeners:
        robot.clock.sleep(0.01)
    go_on.set()
    ending.join(10)
    assert robot.kept_lessons() == [1]


def test_each_change_is_saved_once(robot: KeptRobot) -> None:
    for scene in range(5):
        robot.teach_now(scene)
    robot.autosave.save()
    assert not robot.autosave.has_unsaved
    told = list(robot.told)
    robot.autosave.save_if_changed()
    assert robot.told == told and robot.kept_lessons() == [5]
    robot.clock.result(robot.loop.submit(lambda: undo_examples(robot.loop.history, 5.0)), 5)
    robot.autosave.stop()
    assert robot.kept_lessons() == [0]


def test_a_loaded_model_counts_as_saved_until_something_is_learned(robot: KeptRobot) -> None:
    robot.teach_now(1)
    name = robot.autosave.save()
    robot.teach_now(2)
    robot.autosave.load(name)  # which saves first
    assert not robot.autosave.has_unsaved
    assert robot.loop.history.taught.total() == 2
    robot.teach_now(3)
    assert robot.autosave.has_unsaved


def test_saving_is_tried_again_after_a_disk_error(robot: KeptRobot) -> None:
    robot.disk.is_full = True
    robot.teach_now(1)
    robot.autosave.save_if_changed()
    assert robot.told[-1] == os.strerror(errno.ENOSPC) and robot.autosave.has_unsaved
    robot.disk.is_full = False
    robot.autosave.save_if_changed()
    assert robot.kept_lessons() == [1]
