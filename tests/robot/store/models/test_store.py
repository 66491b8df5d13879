"""Models are saved automatically, in several versions, so that damage to one loses no teaching."""

from __future__ import annotations

import errno
import math
import os
import threading
import unicodedata
from concurrent.futures import Future
from pathlib import Path

import pytest

from robot.errors import ConfigurationError, NotFoundError, RecordingError
from robot.policy.registry import make_policy
from robot.policy.undo import undo_examples
from robot.store.folder import Storage
from robot.store.models.autosave import Autosave
from robot.store.models.journal import Journal
from robot.store.models.model import JournalPosition, Model, encode_model, stamp, take_model
from robot.store.models.store import KEEP_VERSIONS, ModelStore
from robot.types import Action, Example
from tests.kit.sizes import crossed
from tests.robot.bench_robot import BenchRobot

from .lives import Disk, DiskStore
from .test_model import some_model


@pytest.fixture
def told():
    """The events that the store has announced, each with its detail."""
    return []


@pytest.fixture
def store(tmp_path, told):
    """A store whose clock advances by a second at each reading."""
    times = iter(range(1000, 2000))
    return ModelStore(
        Storage(tmp_path),
        lambda: float(next(times)),
        lambda name, detail: told.append((name, detail)),
    )


def versions(store: ModelStore, name: str) -> list[str]:
    return sorted(path.name for path in (store._storage.models / name).iterdir())


def test_only_the_last_versions_stay(store):
    for _ in range(KEEP_VERSIONS + 3):
        path = store.save("kitchen", some_model())
    assert versions(store, "kitchen") == ["00004.npz", "00005.npz", "00006.npz"]
    for version in store.versions("kitchen"):  # its time cannot be shown in the list
        version.write_bytes(encode_model(stamp(some_model(), saved_at_s=math.nan)))
    assert store.summary("kitchen") is None
    path.write_bytes(encode_model(stamp(some_model(), saved_at_s=math.inf)))
    assert store.summary("kitchen") is None


def test_a_damaged_version_is_set_aside_and_the_one_before_is_used(store):
    store.save("kitchen", some_model())
    newest = store.save("kitchen", some_model())
    newest.write_bytes(newest.read_bytes()[:-100])
    assert store.load("kitchen").summary.n_examples == 40
    assert versions(store, "kitchen") == ["00001.npz", "00002.npz.damaged"]
    assert store.aside("kitchen") == ["00002.npz.damaged"]
    store.save("kitchen", some_model())
    assert store.load("kitchen").summary.n_examples == 40


def test_if_the_last_model_is_lost_the_next_best_is_used(store):
    store.save("hall", some_model())
    store.save("kitchen", some_model()).write_bytes(b"")
    store.current = "kitchen"
    assert [name for name, _ in store.good_models()] == ["hall"]
    with pytest.raises(RecordingError, match="damaged versions are kept in"):
        store.load("kitchen")
    assert versions(store, "kitchen") == ["00001.npz.damaged"]


@crossed(kept=[*range(8), None], hurt=[0, 1])
def test_one_damaged_note_of_the_model_in_use_costs_nothing(store, hurt, kept):
    for name in ("robot", "robot (2)"):
        store.save(name, some_model())
    store.current = "robot (2)"
    marker = sorted(store._storage.models.glob("current*.txt"))[hurt]
    if kept is None:
        marker.unlink()
    else:
        marker.write_bytes(marker.read_bytes()[:kept])
    assert store.current == "robot (2)"


@pytest.mark.parametrize("name", [unicodedata.normalize("NFD", "Küche"), "x" * 65, "hall.", "_"])
def test_a_model_whose_folder_somebody_named_is_saved_into_it(store, name):
    folder = store.save("kitchen", some_model()).parent
    folder.rename(folder.with_name(name))
    store.save(name, store.load(name))
    store.current = name
    assert store.names() == [store.current]
    assert len(versions(store, name)) == 2


def everything(folder: Path) -> list[Path]:
    """Return the files in a folder and beside it."""
    return sorted([*folder.parent.iterdir(), *folder.rglob("*")])


@pytest.mark.parametrize("name", ["../out", "/etc", "..", "", "a/b", "con", ".x", "a\0"])
def test_a_name_that_leads_elsewhere_is_refused(store, tmp_path, name):
    before = everything(tmp_path)
    for attempt in (store.load, store.delete, lambda name: store.save(name, some_model())):
        with pytest.raises((ConfigurationError, NotFoundError)):
            attempt(name)
    assert everything(tmp_path) == before


def test_a_full_disk_keeps_the_earlier_version_and_uses_no_new_name(store, monkeypatch):
    store.save("kitchen", some_model())
    own = store._storage.models / "made by a person"
    own.mkdir()

    def refuse(descriptor):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("os.fsync", refuse)
        with pytest.raises(OSError, match="No space"):
            store.save("kitchen", some_model())
        for name in ("hall", own.name):
            with pytest.raises(OSError, match="No space"):
                store.save(name, some_model())
    assert store.load("kitchen").summary.n_examples == 40
    assert store.free_name("hall") == "hall" and own.is_dir()


def test_incomplete_files_of_a_power_cut_are_removed(store):
    storage = store._storage
    half = store.save("kitchen", some_model()).with_name(".00002.npz.123.part")
    half.write_bytes(b"half")
    empty = storage.folder("episodes") / "x.mcap"
    empty.touch()
    storage.sweep()
    assert half.exists() and empty.exists(), "another program may still be writing new files"
    for path in (half, empty):
        os.utime(path, (0, 0))
    storage.sweep()
    assert not half.exists() and not empty.exists()
    assert store.load("kitchen").summary.n_examples == 40


def test_a_model_that_failed_when_it_drove_is_set_aside_at_the_next_start(store, told):
    for name in ("kitchen", "kitchen", "hall"):
        store.save(name, some_model())
    store.note_failure("kitchen", "it divides by zero")
    assert store.set_failed_aside() == ["kitchen"]
    assert told == [("set_aside", "kitchen/00002.npz: it divides by zero")]
    assert versions(store, "kitchen") == ["00001.npz", "00002.npz.failed"]
    assert store.load("kitchen").summary.n_examples == 40
    assert store.set_failed_aside() == [], "a failed version is set aside only once"
    store.retry_damaged()
    assert versions(store, "kitchen") == ["00001.npz", "00002.npz.failed"], "the failed one stays"


def model_of(number: int) -> Model:
    """Return a model that is identified by its place."""
    return stamp(some_model(), place=str(number))


def set_aside(store: ModelStore, name: str) -> None:
    """Treat a model like an older program that cannot read it."""
    for version in store.versions(name):
        version.rename(version.with_name(f"{version.name}.damaged"))


def test_versions_that_an_older_program_set_aside_are_restored(store, told):
    for count in (50, 52, 54):
        store.save("robot", model_of(count))
    store.current = "robot"
    set_aside(store, "robot")
    broken = store._storage.models / "robot/00009.npz.damaged"
    broken.write_bytes(b"broken")
    store.save("robot (2)", model_of(3))
    store.current = "robot (2)"
    store.retry_damaged()
    assert store.load("robot").summary.place == "54"
    assert len(list(store.sound_versions("robot"))) == 3
    assert store.current == "robot (2)", "the model that was saved last stays in use"
    assert [name for name, _ in told] == ["put_back"] * 3
    assert broken.read_bytes() == b"broken"


def test_a_version_that_is_readable_again_is_used_if_it_is_newer(store):
    store.save("old", model_of(3))
    store.save("robot", model_of(54))
    set_aside(store, "robot")
    store.current = "old"
    store.retry_damaged()
    assert (store.current, store.load("robot").summary.place) == ("robot", "54")


def test_a_version_older_than_what_was_saved_since_stays_aside(store):
    store.save("robot", model_of(5))
    set_aside(store, "robot")
    store.save("robot", model_of(9))
    store.retry_damaged()
    assert [model.summary.place for model in store.sound_versions("robot")] == ["9"]
    assert "00001.npz.damaged" in versions(store, "robot")


def test_a_version_saved_since_by_a_clock_that_is_years_late_stays_the_newest(tmp_path):
    now_s = [1.8e9]
    store = ModelStore(Storage(tmp_path), lambda: now_s[0])
    store.save("robot", stamp(model_of(5), position=JournalPosition(run="a", boot=3, change=7)))
    set_aside(store, "robot")
    now_s[0] = 60.0
    store.save("robot", stamp(model_of(9), position=JournalPosition(run="b", boot=4, change=2)))
    store.retry_damaged()
    assert [model.summary.place for model in store.sound_versions("robot")] == ["9"]


# Saved automatically ----------------------------------------------------------------------------


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
        frame, history = self.camera.show(scene), self.loop.history
        example = Example(frame_id=frame.frame_id, label=Action.LEFT, is_intervention=False)
        x = history.policy.extract(frame)
        return self.loop.submit(lambda: history.teach(example, x, frame.captured_s))

    def teach_now(self, scene: int) -> None:
        self.clock.result(self.teach(scene), 5)

    def kept_lessons(self) -> list[int]:
        return [model.summary.n_examples for _, model in self.store.good_models()]


@pytest.fixture
def robot(tmp_path):
    robot = KeptRobot(tmp_path)
    robot.rig.start()
    yield robot
    robot.autosave.stop()
    robot.rig.stop()


def test_a_model_with_moves_that_the_robot_does_not_have_is_named_and_kept(robot):
    truck = take_model(make_policy("published-8", (Action.FORWARD, Action("wave"))), {})
    robot.store.save("truck", truck)
    robot.store.current = "truck"
    assert robot.autosave.load_last() is None
    assert robot.told == ["truck (wave)"]
    robot.store.save("old", some_model())
    assert robot.autosave.load_last() == "old"
    assert robot.told[1:] == ["model_loaded", "truck (wave)"], "the model is loaded first"
    assert versions(robot.store, "truck") == ["00001.npz"]


def test_examples_of_the_current_tick_are_saved(robot):
    """Autosave stops before the loop has reported the tick that taught an example."""
    taught, go_on = threading.Event(), threading.Event()

    def hold_up(tick):
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


def test_each_change_is_saved_once_and_again_after_a_disk_error(robot):
    robot.disk.is_full = True
    robot.teach_now(1)
    robot.autosave.save_if_changed()
    assert robot.told[-1] == os.strerror(errno.ENOSPC) and robot.autosave.has_unsaved
    robot.disk.is_full = False
    robot.autosave.save_if_changed()
    assert robot.kept_lessons() == [1] and not robot.autosave.has_unsaved
    told = list(robot.told)
    robot.autosave.save_if_changed()
    assert robot.told == told
    robot.clock.result(robot.loop.submit(lambda: undo_examples(robot.loop.history, 5.0)), 5)
    robot.autosave.stop()
    assert robot.kept_lessons() == [0]


def test_a_loaded_model_counts_as_saved_until_something_is_learned(robot):
    robot.teach_now(1)
    name = robot.autosave.save()
    robot.teach_now(2)
    robot.autosave.load(name)  # this first saves the model in use
    assert not robot.autosave.has_unsaved
    assert robot.loop.history.taught.total() == 2
    robot.teach_now(3)
    assert robot.autosave.has_unsaved
