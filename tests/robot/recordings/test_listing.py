"""Recordings are read once for the list, and again only after a change."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from robot.recordings import store as store_module
from robot.recordings.store import EpisodeStore
from robot.recordings.summary import EpisodeSummary
from robot.store.folder import Storage

from .drives import record_drive

MANY = 300


@pytest.fixture
def storage(tmp_path: Path) -> Storage:
    storage = Storage(tmp_path / "data")
    (tmp_path / "one").mkdir()
    one = record_drive(tmp_path / "one", frames=10).path
    for i in range(MANY):
        os.link(one, storage.folder("episodes") / f"episode-{i:05d}.mcap")
    return storage


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """The recordings that were opened."""
    opened: list[str] = []
    real = store_module.read_summary

    def note(path: Path, *, is_growing: bool = False) -> EpisodeSummary:
        opened.append(path.stem)
        return real(path, is_growing=is_growing)

    monkeypatch.setattr(store_module, "read_summary", note)
    yield opened


def test_recordings_are_read_once(storage: Storage, read: list[str]) -> None:
    store = EpisodeStore(storage)
    listed = store.summaries()
    assert len(listed) == len(read) == MANY
    read.clear()
    assert store.summaries() == listed
    assert store.summary("episode-00007") == next(c for c in listed if c.id == "episode-00007")
    assert read == []


def test_four_callers_at_once_read_no_more_than_one(storage: Storage, read: list[str]) -> None:
    store = EpisodeStore(storage)
    lists: list[int] = []
    callers = [
        threading.Thread(target=lambda: lists.append(len(store.summaries()))) for _ in range(4)
    ]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join(60)
    assert lists == [MANY] * 4 and len(read) == MANY


def test_only_what_changed_is_read_again(storage: Storage, read: list[str]) -> None:
    store = EpisodeStore(storage)
    store.summaries()
    read.clear()
    store.set_title("episode-00003", "the hall")
    (storage.folder("episodes") / "episode-00004.mcap").unlink()
    (storage.folder("episodes") / "episode-00005.mcap").unlink()
    (storage.folder("episodes") / "episode-00005.mcap").write_bytes(b"rubbish")
    listed = {summary.id: summary for summary in store.summaries()}
    assert sorted(read) == ["episode-00003", "episode-00005"]
    assert listed["episode-00003"].title == "the hall"
    assert "episode-00004" not in listed and not listed["episode-00005"].is_readable
