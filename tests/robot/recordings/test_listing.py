"""Recordings are read once for the list, and again only after a change."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from robot.recordings import store as store_module
from robot.recordings.store import EpisodeStore
from robot.recordings.summary import EpisodeSummary
from robot.store.folder import Storage

from .drives import record_drive

MANY = 300


@pytest.fixture
def store(tmp_path: Path) -> EpisodeStore:
    storage = Storage(tmp_path / "data")
    one = record_drive(tmp_path / "one", frames=10).path
    for i in range(MANY):
        os.link(one, storage.folder("episodes") / f"episode-{i:05d}.mcap")
    return EpisodeStore(storage)


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """A list of the recordings that were opened since the beginning of the test."""
    opened: list[str] = []
    real = store_module.read_summary

    def note(path: Path, *, is_growing: bool = False) -> EpisodeSummary:
        opened.append(path.stem)
        return real(path, is_growing=is_growing)

    monkeypatch.setattr(store_module, "read_summary", note)
    return opened


def test_recordings_are_read_once_even_for_four_callers(
    store: EpisodeStore, read: list[str]
) -> None:
    with ThreadPoolExecutor(4) as callers:
        first, *others = callers.map(lambda _: store.summaries(), range(4))
    assert len(first) == len(read) == MANY
    assert others == [first] * 3 and store.summary("episode-00007") in first
    assert len(read) == MANY


def test_only_what_changed_is_read_again(store: EpisodeStore, read: list[str]) -> None:
    store.summaries()
    read.clear()
    store.set_title("episode-00003", "the hall")
    store.path("episode-00004").unlink()
    changed = store.path("episode-00005")
    changed.unlink()
    changed.write_bytes(b"rubbish")
    listed = {summary.id: summary for summary in store.summaries()}
    assert sorted(read) == ["episode-00003", "episode-00005"]
    assert listed["episode-00003"].title == "the hall"
    assert "episode-00004" not in listed and not listed["episode-00005"].is_readable
