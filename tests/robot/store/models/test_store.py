"""Models by name: stored in versions, so that a damaged version costs no lesson."""

from __future__ import annotations

import os
import unicodedata
from pathlib import Path

import pytest

from robot.errors import ConfigurationError, NotFoundError, RecordingError
from robot.store.folder import Storage
from robot.store.models.model import Model, encode_model, stamp
from robot.store.models.store import KEEP_VERSIONS, ModelStore
from tests.kit.sizes import crossed

from .test_model import some_model


@pytest.fixture
def told() -> list[tuple[str, str]]:
    """The announcements of the store, each with its detail."""
    return []


@pytest.fixture
def store(tmp_path: Path, told: list[tuple[str, str]]) -> ModelStore:
    """A store whose clock goes on by a second with each look."""
    times = iter(range(1000, 2000))
    return ModelStore(
        Storage(tmp_path),
        lambda: float(next(times)),
        lambda name, detail: told.append((name, detail)),
    )


def versions(store: ModelStore, name: str) -> list[str]:
    return sorted(path.name for path in (store._storage.models / name).iterdir())


@pytest.mark.parametrize("saved_at_s", [float("nan"), float("inf")])
def test_a_model_whose_time_no_list_can_hold_counts_as_damaged(
    store: ModelStore, saved_at_s: float
) -> None:
    path = store.save("hall", some_model())
    path.write_bytes(encode_model(stamp(some_model(), saved_at_s=saved_at_s)))
    assert store.summary("hall") is None


def test_only_the_last_versions_stay(store: ModelStore) -> None:
    for _ in range(6):
        store.save("kitchen", some_model())
    assert versions(store, "kitchen") == ["00004.npz", "00005.npz", "00006.npz"]
    assert KEEP_VERSIONS == 3


def test_a_damaged_version_is_set_aside_and_the_one_before_is_used(store: ModelStore) -> None:
    store.save("kitchen", some_model())
    newest = store.save("kitchen", some_model())
    newest.write_bytes(newest.read_bytes()[:-100])
    assert store.load("kitchen").summary.n_examples == 40
    assert versions(store, "kitchen") == ["00001.npz", "00002.npz.damaged"]
    assert store.aside("kitchen") == ["00002.npz.damaged"]
    store.save("kitchen", some_model())
    assert store.load("kitchen").summary.n_examples == 40


def test_if_the_last_model_is_lost_the_next_best_is_used(store: ModelStore) -> None:
    store.save("hall", some_model())
    store.save("kitchen", some_model()).write_bytes(b"")
    store.current = "kitchen"
    assert [name for name, _ in store.good_models()] == ["hall"]
    with pytest.raises(RecordingError, match="damaged versions stay in"):
        store.load("kitchen")
    assert versions(store, "kitchen") == ["00001.npz.damaged"]


@crossed(kept=[*range(8), None], hurt=[0, 1])
def test_one_damaged_note_of_the_model_in_use_costs_nothing(
    store: ModelStore, hurt: int, kept: int | None
) -> None:
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
def test_a_model_whose_folder_somebody_named_is_saved_into_it(store: ModelStore, name: str) -> None:
    folder = store.save("kitchen", some_model()).parent
    folder.rename(folder.with_name(name))
    store.save(name, store.load(name))
    store.current = name
    assert store.names() == [store.current]
    assert len(versions(store, name)) == 2


def everything(folder: Path) -> list[Path]:
    """Return what is in a folder, and its neighbours."""
    return sorted([*folder.parent.iterdir(), *folder.rglob("*")])


@pytest.mark.parametrize(
    "name", ["../out", "/etc", "..", "", " ", "a/b", "a\\b", "con", ".x", "a\0", "x" * 65]
)
def test_a_name_that_leads_elsewhere_is_refused(
    store: ModelStore, tmp_path: Path, name: str
) -> None:
    store.save("kitchen", some_model())
    before = everything(tmp_path)
    for attempt in (
        lambda: store.save(name, some_model()),
        lambda: store.load(name),
        lambda: store.delete(name),
    ):
        with pytest.raises((ConfigurationError, NotFoundError)):
            attempt()
    assert everything(tmp_path) == before


def test_an_upload_that_is_no_model_is_not_kept(store: ModelStore) -> None:
    with pytest.raises(RecordingError):
        store.add_file("kitchen", b"PK\x03\x04 no model")
    assert store.names() == []


def test_a_full_disk_leaves_the_version_before(
    store: ModelStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    store.save("kitchen", some_model())

    def refuse(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("os.fsync", refuse)
        with pytest.raises(OSError, match="No space"):
            store.save("kitchen", some_model())
    assert store.load("kitchen").summary.n_examples == 40


def test_incomplete_files_of_a_power_cut_are_removed(store: ModelStore) -> None:
    storage = store._storage
    half = store.save("kitchen", some_model()).with_name(".00002.npz.123.part")
    half.write_bytes(b"half")
    empty = storage.folder("episodes") / "x.mcap"
    empty.touch()
    storage.sweep()
    assert half.exists() and empty.exists(), "another program may be writing them just now"
    for path in (half, empty):
        os.utime(path, (0, 0))
    storage.sweep()
    assert not half.exists() and not empty.exists()
    assert store.load("kitchen").summary.n_examples == 40


def test_a_model_that_failed_when_it_drove_is_set_aside_at_the_next_start(
    store: ModelStore, told: list[tuple[str, str]]
) -> None:
    for name in ("kitchen", "kitchen", "hall"):
        store.save(name, some_model())
    store.note_failure("kitchen", "it divides by zero")
    assert store.set_failed_aside() == ["kitchen"]
    assert told == [("set_aside", "kitchen/00002.npz: it divides by zero")]
    assert versions(store, "kitchen") == ["00001.npz", "00002.npz.failed"]
    assert store.load("kitchen").summary.n_examples == 40
    assert store.set_failed_aside() == [], "once"
    store.retry_damaged()
    assert versions(store, "kitchen") == ["00001.npz", "00002.npz.failed"], "it stays aside"


def model_of(number: int) -> Model:
    """Return a model that is identified by its place."""
    return stamp(some_model(), place=str(number))


def set_aside(store: ModelStore, name: str) -> None:
    """Treat a model like an older program that cannot read it."""
    for version in (store._storage.models / name).glob("*.npz"):
        version.rename(version.with_name(f"{version.name}.damaged"))


def test_versions_that_an_older_program_set_aside_are_restored(
    store: ModelStore, told: list[tuple[str, str]]
) -> None:
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
    assert store.current == "robot (2)", "what was saved last stays in use"
    assert [name for name, _ in told] == ["put_back"] * 3
    assert broken.read_bytes() == b"broken"


def test_a_version_that_is_readable_again_is_used_if_it_is_newer(store: ModelStore) -> None:
    store.save("old", model_of(3))
    store.save("robot", model_of(54))
    set_aside(store, "robot")
    store.current = "old"
    store.retry_damaged()
    assert (store.current, store.load("robot").summary.place) == ("robot", "54")


def test_a_version_older_than_what_was_saved_since_stays_aside(store: ModelStore) -> None:
    store.save("robot", model_of(5))
    set_aside(store, "robot")
    store.save("robot", model_of(9))
    store.retry_damaged()
    assert [model.summary.place for model in store.sound_versions("robot")] == ["9"]
    assert "00001.npz.damaged" in versions(store, "robot")
