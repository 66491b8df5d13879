"""Models renamed, copied and restored in the data folder."""

from __future__ import annotations

import unicodedata
from pathlib import Path

import pytest

from robot.errors import ConfigurationError, NotFoundError
from robot.store.folder import Storage
from robot.store.models.store import ModelStore
from server.library.models import ModelLibrary
from tests.kit.states import same_state
from tests.robot.store.models.test_model import some_model
from tests.robot.store.models.test_store import everything


@pytest.fixture
def store(tmp_path: Path) -> ModelStore:
    times = iter(range(1000, 2000))
    return ModelStore(Storage(tmp_path), wall_s=lambda: float(next(times)))


@pytest.fixture
def library(tmp_path: Path, store: ModelStore) -> ModelLibrary:
    return ModelLibrary(Storage(tmp_path), store)


def test_a_saved_model_is_listed_and_can_be_loaded(
    store: ModelStore, library: ModelLibrary
) -> None:
    model = some_model()
    store.save("kitchen", model)
    store.save("hall", model)
    store.current = "kitchen"
    hall, kitchen = library.saved()
    assert (hall.name, hall.is_current) == ("hall", False)
    assert (kitchen.name, kitchen.is_current) == ("kitchen", True)
    assert kitchen.summary is not None and kitchen.summary.n_examples == 40
    assert kitchen.summary.place == "the kitchen"
    assert same_state(store.load("kitchen").state, model.state)


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


def test_two_models_cannot_have_one_name(store: ModelStore, library: ModelLibrary) -> None:
    store.save("a", some_model())
    store.save("b", some_model())
    with pytest.raises(ConfigurationError, match="already"):
        library.rename("a", "B")


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


def test_the_preview_is_the_most_used_image(store: ModelStore, library: ModelLibrary) -> None:
    model = some_model()
    store.save("kitchen", model)
    assert library.preview("kitchen").size > 1
