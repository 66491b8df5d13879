"""All data of a participant is found by its name, and no data of anybody else."""

from __future__ import annotations

import unicodedata
from pathlib import Path
from typing import Literal

import pytest

from robot.store.folder import Storage
from server.study.erasing import erase


@pytest.mark.parametrize("form", ["NFC", "NFD"])
def test_data_is_erased_in_every_encoding_of_its_names_accents(
    tmp_path: Path, form: Literal["NFC", "NFD"]
) -> None:
    storage, name = Storage(tmp_path), unicodedata.normalize(form, "Zoé")
    for entry in (f"{name}.mcap", f"{name}-2.edits.json", f"{name}e.mcap"):
        (storage.folder("episodes") / entry).touch()
    storage.discard(storage.folder("episodes") / f"{name}-2.edits.json")
    assert len(erase(storage, ["Zoé"])) == 2
    assert [path.name for path in storage.folder("episodes").iterdir()] == [f"{name}e.mcap"]
