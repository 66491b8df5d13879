"""Models renamed, copied and restored in the data folder."""

from __future__ import annotations

import unicodedata
from pathlib import Path

import pytest

from robot.errors import ConfigurationError, NotFoundError
from robot.store.folder import Storage
from robot.store.models.store import ModelStore
from server.library.models import ModelLibrary
from tests.robot.store.models.test_model import some_model
from tests.robot.store.models.test_store import everything


@pytest.fixture
def store(tmp_path: Path) -> ModelStore:
    times = iter(range(1000, 2000))
    return ModelStore(Storage(tmp_path), wall_s=lambda: float(next(times)))


@pytest.fixture
def library(tmp_path: Path, store: ModelStore) -> ModelLibrary:
    return ModelLibrary(Storage(tmp_path), store)


def test_rename_copy_delete_and_restore(store: ModelStore, library: ModelLibrary) -> None:
    store.save("kitchen", some_model())
    store.current = "kitchen"
    assert library.rename("kitchen", " Küche ") == "Küche"
    assert store.current == "Küche"
    assert library.copy("Küche") == "Küche (2)"
    undo = store.delete("Küche")
    assert store.names() == ["Küche (2)"]
    store.save("KÜCHE", some_model())
    assert library.restore(undo) == "Küche (3)"
    assert store.names() == ["KÜCHE", "Küche (2)", "Küche (3)"]
    with pytest.raises(NotFoundError):
        library.restore(undo)
    with pytest.raises(NotFoundError):
        store.delete("cellar")


def test_names_that_differ_in_how_an_accent_is_written_are_one(
    store: ModelStore, library: ModelLibrary, tmp_path: Path
) -> None:
    (tmp_path / "models" / unicodedata.normalize("NFD", "Küche")).mkdir()
    assert store.free_name("küche") == "küche (2)"
    store.save("hall", some_model())
    with pytest.raises(ConfigurationError, match="already"):
        library.rename("hall", "Küche")


def test_a_name_that_leads_elsewhere_is_refused(
    store: ModelStore, library: ModelLibrary, tmp_path: Path
) -> None:
    store.save("kitchen", some_model())
    before = everything(tmp_path)
    for name in ("../out", "/etc", "..", "", " ", "a/b", "con", ".x", "a\0", "x" * 65):
        for attempt in (
            lambda name: library.rename("kitchen", name),
            lambda name: library.copy("kitchen", name or "."),
        ):
            with pytest.raises((ConfigurationError, NotFoundError)):
                attempt(name)
    assert everything(tmp_path) == before
