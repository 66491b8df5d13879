"""Many recordings at once: deleted, restored, zipped, searched; none disappears while it is
read."""

from __future__ import annotations

import io
import shutil
import subprocess
import sys
import tracemalloc
import zipfile
from pathlib import Path

import pytest

from robot.errors import ConfigurationError, NotFoundError
from robot.recordings.archive import zip_recordings
from robot.recordings.episode import open_episode
from robot.recordings.reading import being_read, reading
from robot.recordings.store import EpisodeStore
from robot.store.folder import TRASH_DAYS, Storage

from .drives import record_drive

pytest.importorskip("mcap.writer", reason="the extra 'episodes' is not installed")
NAMES = ["one", "one.two", "three", "four"]


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_drive(tmp_path_factory.mktemp("drive"), frames=8).path


@pytest.fixture
def store(tmp_path: Path, drive: Path) -> EpisodeStore:
    """Four copies of one drive, each with another title."""
    storage = Storage(tmp_path / "data")
    store = EpisodeStore(storage)
    for name in NAMES:
        shutil.copy(drive, storage.folder("episodes") / f"{name}.mcap")
        store.set_title(name, f"Title of {name}")
    return store


@pytest.fixture
def folder(store: EpisodeStore) -> Path:
    return store.path("one").parent


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_several_recordings_are_deleted_together_and_restored_byte_for_byte(folder: Path) -> None:
    store = EpisodeStore(Storage(folder.parent), recording=lambda: "four")
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
    store: EpisodeStore, folder: Path, drive: Path
) -> None:
    before = content(folder)
    key = store.delete(*NAMES).key or ""
    shutil.copy(drive, folder / "one.mcap")
    assert sorted(store.restore(key)) == ["four", "one (2)", "one.two", "three"]
    assert store.notes("one (2)").title == "Title of one"
    assert store.notes("one.two").title == "Title of one.two"
    assert content(folder)["one (2).mcap"] == before["one.mcap"]


def test_if_the_disk_refuses_one_deletion_none_is_deleted(
    store: EpisodeStore, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, trash, moved = content(folder), folder.parent / "trash", []

    def move(path: Path, target: Path) -> None:
        if target.parent.parent == trash and len(moved) == 3:
            raise PermissionError("another program has it open")
        moved.append(path)
        path.replace(target)

    monkeypatch.setattr("robot.store.folder.move", move)
    with pytest.raises(PermissionError):
        store.delete(*NAMES)
    assert content(folder) == before and list(trash.iterdir()) == []


def test_deleted_recordings_are_removed_after_the_days_in_the_trash(
    store: EpisodeStore, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    storage, now_ns, day_ns = Storage(folder.parent), [10**18], 86_400 * 10**9
    monkeypatch.setattr("time.time_ns", lambda: now_ns[0])
    first = store.delete("one")
    now_ns[0] += (TRASH_DAYS - 1) * day_ns
    second = store.delete("three", "four")
    storage.sweep()
    assert store.trash() == [first.key, second.key]
    now_ns[0] += 2 * day_ns
    used = storage.trash_bytes()
    storage.sweep()
    assert store.trash() == [second.key]
    assert 0 < storage.trash_bytes() < used
    assert storage.empty_trash() and storage.trash_bytes() == 0 == len(store.trash())


def test_no_recording_is_deleted_or_rewritten_while_another_process_reads_it(
    store: EpisodeStore, folder: Path
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
        gone = store.delete("one", "three")
        assert gone.ids == ("three",) and "exported" in gone.kept["one"]
        with pytest.raises(ConfigurationError, match="exported"):
            store.compact("one")
        assert "one.mcap" in being_read(folder)
        reader.kill()  # it ends in some way, and leaves its mark behind
    assert store.delete("one").ids == ("one",)
    assert not list(folder.glob(".reading*"))


def test_a_zip_holds_all_with_their_edits_and_little_is_in_memory(
    folder: Path, drive: Path
) -> None:
    (folder / "large.mcap").write_bytes(drive.read_bytes() + bytes(24 * 2**20))
    paths = [folder / f"{name}.mcap" for name in (*NAMES, "large")]
    made = folder.parent / "all.zip"
    tracemalloc.start()
    with made.open("wb") as file, reading(paths):
        file.writelines(zip_recordings(paths))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 8 * 2**20
    with zipfile.ZipFile(made) as archive:
        assert archive.testzip() is None
        assert {name: archive.read(name) for name in archive.namelist()} == content(folder)


def test_a_recording_in_progress_is_zipped_up_to_its_present_end(
    tmp_path: Path, drive: Path
) -> None:
    path = tmp_path / "now.mcap"
    data = drive.read_bytes()
    path.write_bytes(data[:-900])
    blocks = []
    for block in zip_recordings([path]):
        blocks.append(block)
        with path.open("ab") as file:
            file.write(data[-900:])
    with zipfile.ZipFile(io.BytesIO(b"".join(blocks))) as archive:
        assert archive.read("now.mcap") == data[:-900]


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
def test_a_recording_is_found_by_words(store: EpisodeStore, text: str, found: list[str]) -> None:
    assert sorted(one.id for one in store.summaries() if one.matches(text)) == found


def test_a_copy_is_never_the_newest(store: EpisodeStore, folder: Path, drive: Path) -> None:
    """Its time is that of its original, and its name may be shorter or sort before it."""
    copies = (f"{drive.stem} (2)", f"{drive.stem}.sync-conflict-20260101-120000-ABC")
    for name in (drive.stem, "a", "zz", *copies):
        shutil.copy(drive, folder / f"{name}.mcap")
    assert store.summaries()[0].id == drive.stem == open_episode(drive).id
