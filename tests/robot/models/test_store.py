"""Models by name: kept in versions, so that a damaged one never costs a lesson."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from robot.errors import ConfigurationError, NotFoundError, RecordingError
from robot.models.store import KEEP_VERSIONS, ModelShelf
from robot.storage.folder import Storage

from .test_model import same, some_model


@pytest.fixture
def shelf(tmp_path: Path) -> ModelShelf:
    times = iter(range(1000, 2000))
    return ModelShelf(Storage(tmp_path), wall_s=lambda: float(next(times)))


def versions(shelf: ModelShelf, folder: Path, name: str) -> list[Path]:
    return sorted((folder / "models" / name).iterdir())


def test_what_is_saved_is_listed_and_loaded(shelf: ModelShelf) -> None:
    model = some_model()
    shelf.save("kitchen", model)
    shelf.save("hall", model)
    shelf.current = "kitchen"
    hall, kitchen = shelf.shelved()
    assert (hall.name, hall.is_current) == ("hall", False)
    assert (kitchen.name, kitchen.is_current) == ("kitchen", True)
    assert kitchen.card is not None and kitchen.card.lessons == 40
    assert kitchen.card.place == "the kitchen"
    assert same(shelf.load("kitchen").state, model.state)


def test_only_the_last_versions_stay(shelf: ModelShelf, tmp_path: Path) -> None:
    for _ in range(6):
        shelf.save("kitchen", some_model())
    kept = versions(shelf, tmp_path, "kitchen")
    assert [path.name for path in kept] == ["00004.npz", "00005.npz", "00006.npz"]
    assert len(kept) == KEEP_VERSIONS


def test_a_damaged_version_is_set_aside_and_the_one_before_is_used(
    shelf: ModelShelf, tmp_path: Path
) -> None:
    shelf.save("kitchen", some_model())
    newest = shelf.save("kitchen", some_model())
    newest.write_bytes(newest.read_bytes()[:-100])
    assert shelf.load("kitchen").card.lessons == 40
    assert [path.name for path in versions(shelf, tmp_path, "kitchen")] == [
        "00001.npz",
        "00002.npz.damaged",
    ]
    assert shelf.shelved()[0].damaged == ("00002.npz.damaged",)
    shelf.save("kitchen", some_model())
    assert shelf.load("kitchen").card.lessons == 40


def test_the_next_best_model_serves_where_the_last_one_is_lost(shelf: ModelShelf) -> None:
    shelf.save("hall", some_model())
    only = shelf.save("kitchen", some_model())
    shelf.current = "kitchen"
    only.write_bytes(b"")
    assert [name for name, _ in shelf.good_models()] == ["hall"]
    with pytest.raises(RecordingError, match="damaged ones are still in"):
        shelf.load("kitchen")
    assert only.with_name(only.name + ".damaged").exists()


def test_rename_copy_delete_and_restore(shelf: ModelShelf) -> None:
    shelf.save("kitchen", some_model())
    shelf.current = "kitchen"
    assert shelf.rename("kitchen", " Küche ") == "Küche"
    assert shelf.current == "Küche"
    assert shelf.copy("Küche") == "Küche (2)"
    undo = shelf.delete("Küche")
    assert shelf.names() == ["Küche (2)"]
    shelf.save("KÜCHE", some_model())
    assert shelf.restore(undo) == "Küche (3)"
    assert shelf.names() == ["KÜCHE", "Küche (2)", "Küche (3)"]
    with pytest.raises(NotFoundError):
        shelf.restore(undo)
    with pytest.raises(NotFoundError):
        shelf.delete("cellar")


def test_two_models_cannot_have_one_name(shelf: ModelShelf) -> None:
    shelf.save("a", some_model())
    shelf.save("b", some_model())
    with pytest.raises(ConfigurationError, match="already"):
        shelf.rename("a", "B")


@pytest.mark.parametrize(
    "name", ["../out", "/etc", "..", "", " ", "a/b", "a\\b", "con", ".x", "a\0", "x" * 65]
)
def test_a_name_that_leads_elsewhere_is_refused(
    shelf: ModelShelf, tmp_path: Path, name: str
) -> None:
    shelf.save("kitchen", some_model())
    before = sorted(tmp_path.parent.rglob("*"))
    for attempt in (
        lambda: shelf.save(name, some_model()),
        lambda: shelf.rename("kitchen", name),
        lambda: shelf.load(name),
        lambda: shelf.delete(name),
        lambda: shelf.copy("kitchen", name or "."),
    ):
        with pytest.raises((ConfigurationError, NotFoundError)):
            attempt()
    assert sorted(tmp_path.parent.rglob("*")) == before


def test_an_upload_that_is_no_model_is_not_kept(shelf: ModelShelf) -> None:
    with pytest.raises(RecordingError):
        shelf.add_file("kitchen", b"PK\x03\x04 no model")
    assert shelf.names() == []


def test_a_full_disk_leaves_the_version_before(
    shelf: ModelShelf, monkeypatch: pytest.MonkeyPatch
) -> None:
    shelf.save("kitchen", some_model())

    def refuse(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("os.fsync", refuse)
        with pytest.raises(OSError, match="No space"):
            shelf.save("kitchen", some_model())
    assert shelf.load("kitchen").card.lessons == 40


def test_halves_that_a_power_cut_left_are_swept_away(tmp_path: Path) -> None:
    ModelShelf(Storage(tmp_path)).save("kitchen", some_model())
    half = tmp_path / "models" / "kitchen" / ".00002.npz.123.part"
    half.write_bytes(b"half")
    empty = tmp_path / "episodes" / "x.mcap"
    empty.touch()
    storage = Storage(tmp_path)
    assert ModelShelf(storage).load("kitchen").card.lessons == 40
    storage.sweep()
    assert half.exists() and empty.exists(), "another program may be writing them just now"
    for path in (half, empty):
        os.utime(path, (0, 0))
    storage.sweep()
    assert not half.exists() and not empty.exists()
    assert ModelShelf(storage).load("kitchen").card.lessons == 40
