"""`drivelesson episodes`, as a user types it."""

from __future__ import annotations

import errno
import os
import shutil
import unicodedata
import zipfile
from pathlib import Path
from typing import Any, Literal

import pytest

from robot.recordings.folder import NAME
from robot.recordings.store import EpisodeStore
from robot.store.folder import Storage
from server.__main__ import main
from tests.kit.sizes import crossed
from tests.server.cli.typed import assert_refused_by_a_full_disk, say
from tests.server.test_damaged_folder import DiskThatRefuses


@pytest.mark.parametrize("words", ["episodes compact last", "episodes title last x"])
def test_a_full_disk_is_reported_in_a_sentence_and_nothing_is_lost(
    episode_id: str,
    data: Path,
    words: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert_refused_by_a_full_disk(words, data, monkeypatch, capsys)


@pytest.mark.parametrize("why", [errno.EIO, errno.EROFS])
def test_a_folder_that_cannot_be_written_is_read(
    episode_id: str,
    data: Path,
    tmp_path_factory: pytest.TempPathFactory,
    why: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path_factory.mktemp("out")
    disk = DiskThatRefuses(data, why)
    disk.install(monkeypatch)
    for words, told in {
        "list": episode_id,
        "show last": episode_id,
        "budget": "data folder",
        f"zip last --out {out / 'a.zip'}": "1 episode",
        f"export last --as npz --out {out / 'a.npz'}": "a.npz",
    }.items():
        assert told in say(f"episodes {words}", capsys)
    for words in ("title last x", "delete last", "restore", f"import {out / 'a.zip'}"):
        assert "cannot be used" in say(f"episodes {words}", capsys, status=2)


def test_list_names_parts_without_their_recording(
    episode_id: str, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "is missing" not in say("episodes list", capsys)
    (data / NAME / "gone.parts").mkdir()
    assert "gone.parts, 0.0 MB: gone.mcap is missing" in say("episodes list", capsys)


def test_episodes_are_listed_and_shown(episode_id: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert episode_id in say("episodes list", capsys)
    shown = say("episodes show last", capsys)
    assert "'forward': 20, 'left': 20, 'right': 20" in shown
    pilot = next(line for line in shown.splitlines() if line.startswith("pilot"))
    assert "FFFFLLLLRRRR" in pilot


@crossed(form=["NFC", "NFD"], typed=["Küche", "Kü", unicodedata.normalize("NFD", "Küche")])
def test_a_name_is_found_in_every_encoding_of_its_accents(
    episode_id: str,
    data: Path,
    form: Literal["NFC", "NFD"],
    typed: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = EpisodeStore(Storage(data)).path(episode_id)
    path.rename(path.with_stem(unicodedata.normalize(form, "Küche")))
    say(f"episodes title {typed} Here", capsys)
    assert [one.title for one in EpisodeStore(Storage(data)).summaries()] == ["Here"]


def test_the_command_says_that_nothing_is_recorded_yet(
    data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "nothing is recorded yet" in say("episodes show last", capsys, status=2)


def test_edits_are_made_and_undone(
    episode_id: str, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = EpisodeStore(Storage(data))
    assert "1 edit; " in say("episodes trim last --from 0.5 --to 2.5", capsys)
    say("episodes relabel last --from 1 --to 2 --label right", capsys)
    assert "3 edits" in say("episodes delete last --from 2", capsys)
    assert len(store.notes(episode_id).edits) == 3
    shown = say(f"episodes show {episode_id[:12]}", capsys)
    assert "x" in shown and "edit 2: relabel right" in shown
    say("episodes undo last", capsys)
    assert len(store.notes(episode_id).edits) == 2
    before = store.summary(episode_id).bytes
    say("episodes compact last", capsys)
    assert store.summary(episode_id).bytes < before


def test_delete_restore_and_the_trash(
    episode_id: str, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    say("episodes delete last", capsys)
    assert "no episodes" in say("episodes list", capsys)
    assert f"{episode_id} is back" in say("episodes restore", capsys)
    say("episodes delete last", capsys)
    say("episodes empty-trash", capsys)
    say("episodes restore", capsys, status=2)


def test_the_one_deleted_last_is_restored_whatever_the_clock_says(
    episode_id: str, data: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = EpisodeStore(Storage(data)).path(episode_id)
    for name in ("first", "second"):
        shutil.copy(path, path.with_stem(name))
    for name, now_ns in (("first", 18 * 10**17), ("second", 17 * 10**17)):
        monkeypatch.setattr("time.time_ns", lambda now_ns=now_ns: now_ns)
        say(f"episodes delete {name}", capsys)
    by_hand = data / "trash/old drives"
    by_hand.mkdir()
    path.rename(by_hand / path.name)
    assert say("episodes restore", capsys) == "second is back\n"
    assert say("episodes restore", capsys) == "first is back\n"
    assert "no longer in the trash" in say("episodes restore", capsys, status=2)


def test_forty_episodes_are_zipped_and_deleted_by_one_command(
    episode_id: str, data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, home = EpisodeStore(Storage(data)).path(episode_id), tmp_path / "home.zip"
    for n in range(39):
        shutil.copy(path, path.with_stem(f"{'hall' if n % 3 else 'yard'} {n}"))
    say("episodes title last First", capsys)
    before = {file.name: file.read_bytes() for file in path.parent.iterdir()}
    assert "\n40 episodes " in say("episodes list", capsys)
    listed = say("episodes list --search YARD", capsys)
    assert "\n13 episodes " in listed and "hall" not in listed
    said = say(f"episodes zip --all --out {home} --delete", capsys)
    assert "40 episodes" in said and "30 days" in said
    with zipfile.ZipFile(home) as archive:
        assert {name: archive.read(name) for name in archive.namelist()} == before
    assert EpisodeStore(Storage(data)).ids() == []
    assert say("episodes restore", capsys).count(" is back") == 40
    assert {file.name: file.read_bytes() for file in path.parent.iterdir()} == before
    say("episodes protect last", capsys)
    assert "40 episodes" not in say("episodes delete --all", capsys, status=1)
    assert EpisodeStore(Storage(data)).ids() == [episode_id]
    say(f"episodes import {home}", capsys)
    titles = sorted(one.title for one in EpisodeStore(Storage(data)).summaries())
    assert titles == [""] * 39 + ["First"] * 2


def test_an_export_under_a_wrong_name_is_refused_before_anything_is_read(
    episode_id: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("it was read")

    monkeypatch.setattr("server.recordings.selection.open_episode", refuse)
    for words in ("--as film --out cinema", "--as npz --fps 3", "--as tub --out ."):
        assert say(f"episodes export last {words}", capsys, status=2)


def test_the_budget_offers_recordings_for_deletion_but_deletes_nothing(
    episode_id: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert f"deletable: {episode_id}" in say("episodes budget --gigabytes 0", capsys)
    assert f"{episode_id} is never offered" in say("episodes protect last", capsys)
    assert "deletable" not in say("episodes budget --gigabytes 0", capsys)
    assert f"{episode_id} is again offered" in say("episodes unprotect last", capsys)
    assert f"deletable: {episode_id}" in say("episodes budget --gigabytes 0", capsys)
    assert episode_id in say("episodes list", capsys)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("episodes show nobody", "no episode of this name"),
        ("episodes trim last --from 90 --to 91", "no pictures between"),
        ("episodes delete", "name at least one episode"),
        ("episodes delete last --all", "but not two of these"),
        ("episodes zip --search kitchen", "no episode has 'kitchen'"),
        ("episodes restore 17", "no longer in the trash"),
        ("episodes list --data /proc/x", "cannot be used"),
    ],
)
def test_what_cannot_be_done_is_one_clear_line(
    episode_id: str, words: str, complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    told = say(words, capsys, status=2)
    assert complaint in told.splitlines()[-1]


def test_a_title_is_shown_as_it_is_saved(
    episode_id: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert say("episodes title last " + "x" * 300, capsys) == f"its title is {'x' * 200!r}\n"
    assert "x" * 200 in say("episodes show last", capsys)
    assert main(["episodes", "title", "last", ""]) == 0
    assert capsys.readouterr().out == "it has no title\n"


def test_files_that_stay_in_the_trash_do_not_count_as_freed(
    episode_id: str, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (data / "trash/by-hand.bin").write_bytes(bytes(3_000_000))
    assert say("episodes empty-trash", capsys) == "0.0 MB are free again\n"
    say("episodes delete last", capsys)
    assert say("episodes empty-trash", capsys) != "0.0 MB are free again\n"


def test_space_can_be_freed_on_a_full_disk(
    episode_id: str,
    data: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    say("episodes delete last", capsys)
    real = os.mkdir

    def refuse(path: str, *more: Any, **named: Any) -> None:
        if not Path(path).exists():
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        real(path, *more, **named)

    monkeypatch.setattr(os, "mkdir", refuse)
    assert "trash" in say("episodes budget", capsys)
    say("episodes empty-trash", capsys)
    assert not any((data / "trash").iterdir())


def test_the_remains_of_a_killed_import_are_listed_and_removed_by_the_next_import(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = Storage(tmp_path / "data")
    left = data.root / "episodes"
    for name, size in (("tub.mcap", 0), (".tub.mcap.4711.part", 69_000)):
        (left / name).write_bytes(bytes(size))
        os.utime(left / name, (1.0, 1.0))
    (left / ".new.mcap.4712.part").write_bytes(b"on its way")
    words = ["--data", str(data.root)]
    assert main(["episodes", "list", *words]) == 0
    said = capsys.readouterr().out
    assert "unfinished: episodes/tub.mcap, 0.0 MB" in said
    assert "unfinished: episodes/.tub.mcap.4711.part, 0.1 MB" in said
    assert "4712" not in said
    assert main(["episodes", "import", str(tmp_path / "nothing"), *words]) == 2
    assert [path.name for path in left.iterdir()] == [".new.mcap.4712.part"]
