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
def store(tmp_path: Path) -> ModelStore:
    times = iter(range(1000, 2000))
    return ModelStore(Storage(tmp_path), wall_s=lambda: float(next(times)))


def versions(store: ModelStore, folder: Path, name: str) -> list[Path]:
    return sorted((folder / "models" / name).iterdir())


@pytest.mark.parametrize("saved_at_s", [float("nan"), float("inf")])
def test_a_model_whose_time_no_list_can_hold_counts_as_damaged(
    store: ModelStore, tmp_path: Path, saved_at_s: float
) -> None:
    (tmp_path / "models" / "hall").mkdir()
    data = encode_model(stamp(some_model(), saved_at_s=saved_at_s))
    (tmp_path / "models" / "hall" / "00001.npz").write_bytes(data)
    assert store.summary("hall") is None


def test_only_the_last_versions_stay(store: ModelStore, tmp_path: Path) -> None:
    for _ in range(6):
        store.save("kitchen", some_model())
    kept = versions(store, tmp_path, "kitchen")
    assert [path.name for path in kept] == ["00004.npz", "00005.npz", "00006.npz"]
    assert len(kept) == KEEP_VERSIONS


def test_a_damaged_version_is_set_aside_and_the_one_before_is_used(
    store: ModelStore, tmp_path: Path
) -> None:
    store.save("kitchen", some_model())
    newest = store.save("kitchen", some_model())
    newest.write_bytes(newest.read_bytes()[:-100])
    assert store.load("kitchen").summary.n_examples == 40
    assert [path.name for path in versions(store, tmp_path, "kitchen")] == [
        "00001.npz",
        "00002.npz.damaged",
    ]
    assert store.aside("kitchen") == ["00002.npz.damaged"]
    store.save("kitchen", some_model())
    assert store.load("kitchen").summary.n_examples == 40


def test_the_next_best_model_serves_where_the_last_one_is_lost(store: ModelStore) -> None:
    store.save("hall", some_model())
    only = store.save("kitchen", some_model())
    store.current = "kitchen"
    only.write_bytes(b"")
    assert [name for name, _ in store.good_models()] == ["hall"]
    with pytest.raises(RecordingError, match="damaged versions stay in"):
        store.load("kitchen")
    assert only.with_name(only.name + ".damaged").exists()


@crossed(kept=[*range(8), None], hurt=[0, 1])
def test_one_damaged_note_of_the_model_in_use_costs_nothing(
    store: ModelStore, tmp_path: Path, hurt: int, kept: int | None
) -> None:
    for name in ("robot", "robot (2)"):
        store.save(name, some_model())
    store.current = "robot (2)"
    marker = sorted((tmp_path / "models").glob("current*.txt"))[hurt]
    if kept is None:
        marker.unlink()
    else:
        marker.write_bytes(marker.read_bytes()[:kept])
    assert store.current == "robot (2)"


@pytest.mark.parametrize("name", [unicodedata.normalize("NFD", "Küche"), "x" * 65, "hall.", "_"])
def test_a_model_whose_folder_somebody_named_is_saved_into_it(
    store: ModelStore, tmp_path: Path, name: str
) -> None:
    store.save("kitchen", some_model())
    (tmp_path / "models/kitchen").rename(tmp_path / "models" / name)
    store.save(name, store.load(name))
    store.current = name
    assert store.names() == [store.current]
    assert len(versions(store, tmp_path, name)) == 2


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


def test_halves_that_a_power_cut_left_are_swept_away(tmp_path: Path) -> None:
    ModelStore(Storage(tmp_path)).save("kitchen", some_model())
    half = tmp_path / "models" / "kitchen" / ".00002.npz.123.part"
    half.write_bytes(b"half")
    empty = tmp_path / "episodes" / "x.mcap"
    empty.touch()
    storage = Storage(tmp_path)
    assert ModelStore(storage).load("kitchen").summary.n_examples == 40
    storage.sweep()
    assert half.exists() and empty.exists(), "another program may be writing them just now"
    for path in (half, empty):
        os.utime(path, (0, 0))
    storage.sweep()
    assert not half.exists() and not empty.exists()
    assert ModelStore(storage).load("kitchen").summary.n_examples == 40


def test_a_model_that_failed_when_it_drove_is_set_aside_at_the_next_start(tmp_path: Path) -> None:
    told: list[str] = []
    store = ModelStore(Storage(tmp_path), announce=lambda name, detail: told.append(detail))
    for _ in range(2):
        store.save("kitchen", some_model())
    store.save("hall", some_model())
    store.note_failure("kitchen", "it divides by zero")
    assert store.set_failed_aside() == ["kitchen"]
    assert told == ["kitchen/00002.npz: it divides by zero"]
    names = [path.name for path in versions(store, tmp_path, "kitchen")]
    assert names == ["00001.npz", "00002.npz.failed"]
    assert store.load("kitchen").summary.n_examples == 40
    assert store.set_failed_aside() == [], "once"


def model_of(number: int) -> Model:
    """Return a model that is identified by its place."""
    return stamp(some_model(), place=str(number))


def aside(store: ModelStore, tmp_path: Path, name: str) -> None:
    """Treat a model like an older program that cannot read it."""
    for version in (tmp_path / "models" / name).glob("*.npz"):
        version.rename(version.with_name(f"{version.name}.damaged"))


def test_versions_that_an_older_program_set_aside_come_back(tmp_path: Path) -> None:
    wall, told = [100.0], []
    store = ModelStore(
        Storage(tmp_path), lambda: wall[0], lambda name, **fields: told.append((name, fields))
    )
    for count in (50, 52, 54):
        wall[0] += 1
        store.save("robot", model_of(count))
    store.current = "robot"
    aside(store, tmp_path, "robot")
    (tmp_path / "models/robot/00009.npz.damaged").write_bytes(b"broken")
    wall[0] += 1
    store.save("robot (2)", model_of(3))
    store.current = "robot (2)"
    store.retry_damaged()
    assert store.load("robot").summary.place == "54"
    assert len(list(store.sound_versions("robot"))) == 3
    assert store.current == "robot (2)", "what was saved last stays in use"
    assert [name for name, _ in told] == ["put_back"] * 3
    assert (tmp_path / "models/robot/00009.npz.damaged").read_bytes() == b"broken"


def test_a_version_that_comes_back_is_used_where_the_one_in_use_is_older(tmp_path: Path) -> None:
    wall = [100.0]
    store = ModelStore(Storage(tmp_path), lambda: wall[0])
    store.save("old", model_of(3))
    wall[0] += 1
    store.save("robot", model_of(54))
    aside(store, tmp_path, "robot")
    store.current = "old"
    store.retry_damaged()
    assert (store.current, store.load("robot").summary.place) == ("robot", "54")


def test_a_version_older_than_what_was_saved_since_stays_aside(tmp_path: Path) -> None:
    wall = [100.0]
    store = ModelStore(Storage(tmp_path), lambda: wall[0])
    store.save("robot", model_of(5))
    aside(store, tmp_path, "robot")
    wall[0] += 1
    store.save("robot", model_of(9))
    store.retry_damaged()
    assert [model.summary.place for model in store.sound_versions("robot")] == ["9"]
    assert (tmp_path / "models/robot/00001.npz.damaged").exists()


def test_a_version_that_failed_when_it_drove_does_not_come_back(tmp_path: Path) -> None:
    store = ModelStore(Storage(tmp_path))
    store.save("robot", model_of(5))
    store.note_failure("robot", "it raised")
    store.set_failed_aside()
    store.retry_damaged()
    assert list(store.sound_versions("robot")) == []
    assert store.aside("robot") == ["00001.npz.failed"]
