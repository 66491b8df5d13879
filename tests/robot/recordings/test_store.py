"""Episodes on disk are listed, edited, deleted, restored, compacted and zipped.

No episode disappears while it is read."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tracemalloc
import zipfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest

from robot.errors import ConfigurationError, NotFoundError, RecordingError
from robot.recordings import store as store_module
from robot.recordings.archive import zip_recordings
from robot.recordings.editing import write_edited
from robot.recordings.edits import Edit, Notes, notes_path, trim, write_notes
from robot.recordings.episode import open_episode, taught_frames
from robot.recordings.reading import being_read, reading
from robot.recordings.store import EpisodeStore
from robot.recordings.summary import read_summary
from robot.recordings.trash import TRASH_DAYS, remove_old
from robot.store.folder import Storage
from robot.store.lock import FolderLock
from robot.testing import VirtualClock
from robot.types import Action

from .drives import RecordedBench, record_drive

NAMES = ["one", "one.two", "three", "four"]


@pytest.fixture
def storage(tmp_path: Path) -> Storage:
    return Storage(tmp_path / "data")


@pytest.fixture
def folder(storage: Storage) -> Path:
    return storage.folder("episodes")


@pytest.fixture
def store(storage: Storage, folder: Path) -> EpisodeStore:
    """A store with one recording of 60 examples."""
    record_drive(folder)
    return EpisodeStore(storage)


@pytest.fixture
def name(store: EpisodeStore) -> str:
    return store.ids()[0]


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_drive(tmp_path_factory.mktemp("drive"), frames=8).path


@pytest.fixture
def four(storage: Storage, folder: Path, drive: Path) -> EpisodeStore:
    """A store with four copies of one drive, each with its own title."""
    store = EpisodeStore(storage)
    for name in NAMES:
        shutil.copy(drive, folder / f"{name}.mcap")
        store.set_title(name, f"Title of {name}")
    return store


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


# Listed ------------------------------------------------------------------------------------------


def test_a_list_shows_what_an_episode_holds(store: EpisodeStore) -> None:
    [summary] = store.summaries()
    episode = store.open(summary.id)
    assert summary.damage is None and summary.is_readable
    assert summary.frames == len(episode.frames)
    assert dict(summary.taught) == {"forward": 20, "left": 20, "right": 20}
    assert summary.duration_s == pytest.approx(episode.duration_s, abs=0.01)
    assert summary.started_at_s == pytest.approx(episode.origin_ns / 1e9 + 100, abs=5)


def test_a_recording_is_read_once_and_again_only_after_a_change(
    four: EpisodeStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[str] = []

    def note(path: Path, *, is_growing: bool = False) -> Any:
        read.append(path.stem)
        return read_summary(path, is_growing=is_growing)

    monkeypatch.setattr(store_module, "read_summary", note)
    with ThreadPoolExecutor(4) as callers:
        first, *others = callers.map(lambda _: four.summaries(), range(4))
    assert sorted(read) == sorted(NAMES)
    assert others == [first] * 3 and four.summary("one") in first
    read.clear()
    four.set_title("three", "the hall")
    four.path("four").unlink()
    changed = four.path("one")
    changed.unlink()
    changed.write_bytes(b"rubbish")
    listed = {summary.id: summary for summary in four.summaries()}
    assert sorted(read) == ["one", "three"]
    assert listed["three"].title == "the hall"
    assert "four" not in listed and not listed["one"].is_readable


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("TITLE of ONE.two", ["one.two"]),
        ("one", ["one", "one.two"]),
        ("2023 bench left", sorted(NAMES)),
        ("published-8 three", ["three"]),
        ("kitchen", []),
    ],
)
def test_a_recording_is_found_by_words(four: EpisodeStore, text: str, found: list[str]) -> None:
    assert sorted(one.id for one in four.summaries() if one.matches(text)) == found


def test_a_copy_is_never_the_newest(four: EpisodeStore, folder: Path, drive: Path) -> None:
    """A copy has the time of its original, but its name may be shorter or sort before the
    original's."""
    copies = (f"{drive.stem} (2)", f"{drive.stem}.sync-conflict-20260101-120000-ABC")
    for name in (drive.stem, "a", "zz", *copies):
        shutil.copy(drive, folder / f"{name}.mcap")
    assert four.summaries()[0].id == drive.stem == open_episode(drive).id


@pytest.mark.parametrize(
    "strange",
    [
        *("../x", "..", "/etc/passwd", "", "a/../b", "a/b", "a\\b", ".index"),
        *("\ud83d", "\udcff", "x" * 10_000, "a\0b"),
    ],
)
def test_a_strange_name_is_not_found_and_leads_nowhere(store: EpisodeStore, strange: str) -> None:
    attempts = store.summary, store.open, store.notes, store.delete, store.compact, store.restore
    for attempt in attempts:
        with pytest.raises(NotFoundError):
            attempt(strange)


@pytest.mark.parametrize("damaged", [b"{", b"\xf4", b"", b"[]", b'{"edits": 1}', b" " * 2**25])
def test_damaged_notes_are_named_and_hide_no_episode(
    store: EpisodeStore, name: str, damaged: bytes
) -> None:
    notes_path(store.path(name)).write_bytes(damaged)
    assert "edits.json is damaged" in str(store.summary(name).damage)
    assert len(taught_frames(store.open(name))) == 60
    with pytest.raises(RecordingError, match="damaged"):
        store.set_title(name, "x")


# Edited and compacted ----------------------------------------------------------------------------


def test_edits_are_kept_beside_the_file_and_can_all_be_undone(
    store: EpisodeStore, name: str
) -> None:
    path = store.path(name)
    before = path.read_bytes()
    ids = list(store.open(name).frames)
    store.edit(name, Edit(verb="delete", ranges=((ids[5], ids[9]),)))
    store.edit(name, Edit(verb="relabel", ranges=((ids[0], ids[20]),), label=Action.RIGHT))
    store.set_title(name, "  Flur, abends ")
    store.protect(name, True)
    notes = EpisodeStore(Storage(path.parent.parent)).notes(name)
    assert (notes.title, notes.is_protected, len(notes.edits)) == ("Flur, abends", True, 2)
    assert sum(map(notes.is_deleted, ids)) == 5
    assert path.read_bytes() == before
    for _ in range(2):
        store.undo_edit(name)
    assert store.notes(name).edits == ()
    with pytest.raises(ConfigurationError, match="nothing to undo"):
        store.undo_edit(name)
    for title in ("Fl\udcfcr", "\ud83d", "Küche"):
        store.set_title(name, title)
        assert store.notes(name).title == title.encode(errors="replace").decode()


def test_edits_made_during_compacting_are_not_lost(
    storage: Storage, store: EpisodeStore, name: str
) -> None:
    other, path, ids = EpisodeStore(storage), store.path(name), list(store.open(name).frames)
    changes: list[Callable[[], object]] = [
        lambda: other.edit(name, trim(ids, ids[5], ids[-5])),
        lambda: path.write_bytes(path.read_bytes() + b" "),
        lambda: other.delete(name),
    ]
    for change in changes:

        def write_slowly(*what: Any, change: Callable[[], object] = change, **how: Any) -> None:
            write_edited(*what, **how)
            change()

        with pytest.raises((ConfigurationError, NotFoundError)):
            EpisodeStore(storage, write=write_slowly).compact(name)
    assert len(store.notes(name).edits) == 1 and store.ids() == [name]


def test_notes_of_a_recording_that_is_gone_edit_no_new_one(store: EpisodeStore) -> None:
    path = store.new_path("tub")
    write_notes(path, Notes(edits=(Edit(verb="delete", ranges=((1, 9),)),)))
    assert path.name == "tub.mcap" and store.new_path("Tub").name == "Tub (2).mcap"


# Deleted and restored ----------------------------------------------------------------------------


def test_several_recordings_are_deleted_together_and_restored_byte_for_byte(
    four: EpisodeStore, storage: Storage, folder: Path
) -> None:
    store = EpisodeStore(storage, recording=lambda: "four")
    store.protect("three", True)
    before = content(folder)
    gone = store.delete(*NAMES, "nobody", "one")
    assert gone.ids == ("one", "one.two") and set(gone.kept) == {"three", "four", "nobody"}
    assert "protected" in gone.kept["three"] and "being recorded" in gone.kept["four"]
    assert sorted(store.ids()) == ["four", "three"]
    assert store.trash() == [gone.key]
    assert store.restore(gone.key or "") == ["one", "one.two"]
    assert content(folder) == before
    with pytest.raises(NotFoundError):
        store.restore(gone.key or "")
    for alone in ("three", "four", "nobody"):
        with pytest.raises((ConfigurationError, NotFoundError)):
            store.delete(alone)
    with pytest.raises(ConfigurationError, match="being recorded"):
        store.compact("four")
    assert store.trash() == []


def test_restored_recordings_get_new_names_beside_new_ones_and_keep_their_edits(
    four: EpisodeStore, folder: Path, drive: Path
) -> None:
    before = content(folder)
    key = four.delete(*NAMES).key or ""
    shutil.copy(drive, folder / "one.mcap")
    assert sorted(four.restore(key)) == ["four", "one (2)", "one.two", "three"]
    assert four.notes("one (2)").title == "Title of one"
    assert four.notes("one.two").title == "Title of one.two"
    assert content(folder)["one (2).mcap"] == before["one.mcap"]


def test_if_the_disk_refuses_one_deletion_none_is_deleted(
    four: EpisodeStore, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, trash, moved = content(folder), folder.parent / "trash", []

    def move(path: Path, target: Path) -> None:
        if target.parent.parent == trash and len(moved) == 3:
            raise PermissionError("another program has it open")
        moved.append(path)
        path.replace(target)

    monkeypatch.setattr("robot.store.folder.move", move)
    with pytest.raises(PermissionError):
        four.delete(*NAMES)
    assert content(folder) == before and list(trash.iterdir()) == []


def test_deleted_recordings_are_removed_after_the_days_in_the_trash(
    four: EpisodeStore, storage: Storage
) -> None:
    now_s, day_s = 1e9, 86_400.0
    store = EpisodeStore(storage, wall_s=lambda: now_s)
    first = store.delete("one")
    for _ in range(TRASH_DAYS // 5):
        remove_old(storage, now_s)
        now_s += 5 * day_s
    second = store.delete("three", "four")
    remove_old(storage, now_s)
    assert four.trash() == [first.key, second.key]
    used = storage.trash_bytes()
    remove_old(storage, now_s + day_s)
    assert four.trash() == [second.key]
    assert 0 < storage.trash_bytes() < used
    assert storage.empty_trash() and storage.trash_bytes() == 0 == len(four.trash())


def test_a_clock_that_is_years_off_and_then_set_empties_no_trash(
    folder: Path, storage: Storage
) -> None:
    """A computer whose clock has no battery starts in 1970, or at the time of its disk image."""
    clock = VirtualClock(0.0)
    store = EpisodeStore(storage, wall_s=clock.wall_s)
    keys = []
    starts = ("1970-01-01", "2023-05-03", "2026-11-30", "1970-01-01", "2026-11-30", "2038-01-19")
    for year in (*starts, "2026-12-01", "2026-12-02"):
        clock.set_wall(datetime.fromisoformat(f"{year}T12:00:00+00:00").timestamp())
        remove_old(storage, clock.wall_s())
        keys.append(store.delete(record_drive(folder, frames=5).id).key)
    assert store.trash() == keys


def test_beyond_the_budget_the_oldest_unprotected_are_offered_and_none_is_deleted(
    storage: Storage, folder: Path
) -> None:
    ids = [record_drive(folder, frames=20).id for _ in range(4)]
    store = EpisodeStore(storage)
    store.protect(ids[0], True)
    size = store.summary(ids[0]).bytes
    store.budget_bytes = size * 5 // 2
    assert [summary.id for summary in store.offered()] == ids[1:3]
    assert len(store.ids()) == 4
    store.budget_bytes = size * 10
    assert store.offered() == []


# In use ------------------------------------------------------------------------------------------


def test_a_recording_of_another_program_in_progress_is_not_touched(
    storage: Storage, store: EpisodeStore, folder: Path
) -> None:
    robot = RecordedBench(folder)
    with FolderLock(storage.root):
        robot.drive(range(20))
        robot.stand(1.0)
        episode_id, done = store.ids()
        for refused in (store.delete, store.compact):
            with pytest.raises(ConfigurationError, match=r"not finished: another drivelesson \("):
                refused(episode_id)
        store.compact(done)
        robot.drive(range(20, 60))
        robot.finish()
        assert store.summary(episode_id).taught == {"forward": 20, "left": 20, "right": 20}
        store.delete(episode_id)


def test_a_recording_that_was_cut_short_is_no_longer_in_progress(
    store: EpisodeStore, name: str
) -> None:
    path = store.path(name)
    path.write_bytes(path.read_bytes()[:-1])
    store.compact(name)
    path.write_bytes(path.read_bytes()[:3])
    store.delete(name)


def test_no_recording_is_deleted_or_rewritten_while_another_process_reads_it(
    four: EpisodeStore, folder: Path
) -> None:
    code = (
        "import sys, pathlib\n"
        "from robot.recordings.reading import reading\n"
        f"with reading([pathlib.Path({str(folder / 'one.mcap')!r})]):\n"
        "    print('reading', flush=True)\n"
        "    sys.stdin.readline()\n"
    )
    command, pipe = [sys.executable, "-c", code], subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as reader:
        assert reader.stdout is not None and reader.stdout.readline() == "reading\n"
        gone = four.delete("one", "three")
        assert gone.ids == ("three",) and "exported" in gone.kept["one"]
        with pytest.raises(ConfigurationError, match="exported"):
            four.compact("one")
        assert "one.mcap" in being_read(folder)
        reader.kill()  # the reader ends without removing its mark
    assert four.delete("one").ids == ("one",)
    assert not list(folder.glob(".reading*"))


def test_a_zip_holds_all_with_their_edits_up_to_their_present_end(
    four: EpisodeStore, folder: Path, drive: Path
) -> None:
    """Only some of the recordings are in memory, and the last one is still being written."""
    large, made = folder / "large.mcap", folder.parent / "all.zip"
    large.write_bytes(drive.read_bytes() + bytes(24 * 2**20))
    paths, before = [*(folder / f"{name}.mcap" for name in NAMES), large], content(folder)
    tracemalloc.start()
    with made.open("wb") as file, reading(paths):
        for block in zip_recordings(paths):
            file.write(block)
            if len(block) > 2**19:
                with large.open("ab") as recorded:
                    recorded.write(b"meanwhile")
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 8 * 2**20
    with zipfile.ZipFile(made) as archive:
        assert archive.testzip() is None
        assert {name: archive.read(name) for name in archive.namelist()} == before
