"""`drivelesson episodes`, as a user types it. tests/server/exchange tests exports and imports."""

import argparse
import errno
import os
import shutil
import unicodedata
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot.recordings.folder import NAME
from robot.recordings.store import EpisodeStore
from robot.store.folder import Storage
from robot.types import Action
from server.__main__ import main
from server.recordings.command import configure
from tests.kit.disk import Disk
from tests.kit.sizes import crossed
from tests.robot.exchange.imported import import_pictures


def test_a_recording_is_listed_shown_edited_titled_and_compacted(episode_id, data, say, capsys):
    store = EpisodeStore(Storage(data))
    assert episode_id in say("episodes list")
    shown = say("episodes show last")
    assert "'forward': 20, 'left': 20, 'right': 20" in shown
    pilot = next(line for line in shown.splitlines() if line.startswith("pilot"))
    assert "FFFFLLLLRRRR" in pilot
    assert say("episodes title last " + "x" * 300) == f"the title is now {'x' * 200!r}\n"
    assert "x" * 200 in say("episodes show last")
    assert main(["episodes", "title", "last", ""]) == 0
    assert capsys.readouterr().out == "the title was removed\n"
    assert "1 edit; " in say("episodes trim last --from 0.5 --to 2.5")
    say("episodes relabel last --from 1 --to 2 --label right")
    assert "3 edits" in say("episodes delete last --from 2")
    assert len(store.notes(episode_id).edits) == 3
    shown = say(f"episodes show {episode_id[:12]}")
    assert "x" in shown and "edit 2: relabel right" in shown
    say("episodes undo last")
    assert len(store.notes(episode_id).edits) == 2
    before = store.summary(episode_id).bytes
    say("episodes compact last")
    assert store.summary(episode_id).bytes < before


def test_several_episodes_are_zipped_deleted_restored_and_imported_by_one_command_each(
    episode_id, data, tmp_path, say
):
    store, home = EpisodeStore(Storage(data)), tmp_path / "home.zip"
    path = store.path(episode_id)
    for name in ("hall", "yard"):
        shutil.copy(path, path.with_stem(name))
    listed = say("episodes list --search YARD")
    assert "yard" in listed and "hall" not in listed
    assert "3 episodes" in say(f"episodes zip --all --out {home} --delete")
    assert store.ids() == []
    assert say("episodes restore").count(" was restored") == 3
    assert f"{episode_id} is never suggested" in say("episodes protect last")
    assert "3 episodes" not in say("episodes delete --all", status=1)
    assert store.ids() == [episode_id]
    assert "deletable" not in say("episodes budget --gigabytes 0")
    assert f"{episode_id} is again suggested" in say("episodes unprotect last")
    assert f"deletable: {episode_id}" in say("episodes budget --gigabytes 0")
    say(f"episodes import {home}")
    assert len(store.ids()) == 4


VERBS = (
    "list;show last;trim last;delete last;relabel last --label left;undo last;zip --all;restore;"
    "compact last;title last x;protect last;unprotect last;budget;empty-trash;play last;"
    "export last --as npz"
)


def test_a_mistyped_data_folder_or_file_is_named_and_nothing_is_created(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DRIVELESSON_DATA", raising=False)
    parser = argparse.ArgumentParser()
    configure(parser)
    [verbs] = parser._subparsers._group_actions
    lines = VERBS.split(";")
    assert set(verbs.choices or ()) == {line.split()[0] for line in lines} | {"import"}
    for words in (*(f"episodes {line}" for line in lines), "learn last", "player-key"):
        assert main([*words.split(), "--data", "typo"]) == 2
        assert "there is no data folder typo" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "there").mkdir()
    for words in ("episodes show typo.mcap", "learn typo.mcap"):
        assert main([*words.split(), "--data", "there"]) == 2
        assert "there is no file typo.mcap" in capsys.readouterr().err
    assert list((tmp_path / "there").iterdir()) == []


@pytest.mark.parametrize("theirs_first", [True, False])
def test_the_word_last_means_the_newest_by_time_not_by_name(episode_id, data, theirs_first, say):
    (data / "none").mkdir()
    assert "no episodes in" in say(f"episodes list --data {data}/none")
    assert "nothing is recorded yet" in say(f"episodes show last --data {data}/none", status=2)
    own = EpisodeStore(Storage(data)).open(episode_id)
    began_s = own.started_at_s + (-86_400 if theirs_first else 86_400)
    black = np.zeros((3, 120, 160, 3), np.uint8)
    path = data / NAME / "their long hall.mcap"
    import_pictures(path, black, [Action.LEFT] * 3, started_at_s=began_s)
    newest = episode_id if theirs_first else "their long hall"
    assert newest in say("episodes show last")
    say("episodes export last --as folder")
    [exported] = (data / "exports").iterdir()
    assert exported.name == f"{newest.replace(' ', '-')}-folder"
    assert newest in say("episodes delete last")


@crossed(form=["NFC", "NFD"], typed=["Küche", "Kü", unicodedata.normalize("NFD", "Küche")])
def test_a_name_is_found_in_every_encoding_of_its_accents(episode_id, data, form, typed, say):
    path = EpisodeStore(Storage(data)).path(episode_id)
    path.rename(path.with_stem(unicodedata.normalize(form, "Küche")))
    say(f"episodes title {typed} Here")
    assert [one.title for one in EpisodeStore(Storage(data)).summaries()] == ["Here"]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("show nobody", "no episode matches"),
        ("trim last --from 90 --to 91", "no pictures between"),
        ("delete", "name at least one episode"),
        ("delete last --all", "give only one of these"),
        ("zip --search kitchen", "no episode matches 'kitchen'"),
        ("restore 17", "no longer in the trash"),
        ("list --data /proc/x", "there is no data folder /proc/x"),
        ("import /nowhere --data /proc/x", "cannot be used"),
        ("export last --as tub --out /proc/x", "cannot write"),
        ("export last --as folder --fps 5 --task x", "--as folder does not use --fps, --task"),
        ("export last --as film --all", "--as film does not use --all; omit it"),
        ("import /nowhere --name a/b", "'a/b' is not a valid name"),
        ("import /nowhere", "nowhere does not exist"),
        ("import /nowhere --threshold 7", "--threshold"),
        ("play nobody", "no episode matches"),
    ],
)
def test_what_cannot_be_done_is_reported_in_one_line(episode_id, words, complaint, say):
    assert complaint in say(f"episodes {words}", status=2).splitlines()[-1]


# The folder and the disk -------------------------------------------------------------------------


@pytest.mark.parametrize("why", [errno.EIO, errno.EROFS])
def test_a_folder_that_cannot_be_written_is_read(
    episode_id, data, tmp_path_factory, why, monkeypatch, say
):
    out = tmp_path_factory.mktemp("out")
    disk = Disk(data)
    disk.install(monkeypatch.setattr)
    disk.fail(0, lasts=True, why=why)
    monkeypatch.setattr(os, "fsync", lambda handle: None)  # also outside `data`
    for words, told in {
        "list": episode_id,
        "show last": episode_id,
        "budget": "data folder",
        f"zip last --out {out / 'a.zip'}": "1 episode",
        f"export last --as npz --out {out / 'a.npz'}": "a.npz",
    }.items():
        assert told in say(f"episodes {words}")
    for words in ("title last x", "delete last", "restore", f"import {out / 'a.zip'}"):
        assert "cannot be used" in say(f"episodes {words}", status=2)


def test_the_recording_deleted_last_is_restored_whatever_the_clock_says(
    episode_id, data, monkeypatch, say
):
    path = EpisodeStore(Storage(data)).path(episode_id)
    for name in ("first", "second"):
        shutil.copy(path, path.with_stem(name))
    for name, now_ns in (("first", 18 * 10**17), ("second", 17 * 10**17)):
        monkeypatch.setattr("time.time_ns", lambda now_ns=now_ns: now_ns)
        say(f"episodes delete {name}")
    by_hand = data / "trash/old drives"
    by_hand.mkdir()
    path.rename(by_hand / path.name)
    assert say("episodes restore") == "second was restored\n"
    assert say("episodes restore") == "first was restored\n"
    assert "no longer in the trash" in say("episodes restore", status=2)


def test_the_trash_is_emptied_also_on_a_full_disk_and_says_what_is_free_again(
    episode_id, data, monkeypatch, say
):
    (data / "trash/by-hand.bin").write_bytes(bytes(3_000_000))  # this file stays
    assert say("episodes empty-trash") == "0.0 MB are free again\n"
    say("episodes delete last")
    real = os.mkdir

    def refuse(path: str, *more: Any, **named: Any) -> None:
        if not Path(path).exists():
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        real(path, *more, **named)

    monkeypatch.setattr(os, "mkdir", refuse)
    assert "trash" in say("episodes budget")
    assert say("episodes empty-trash") != "0.0 MB are free again\n"
    assert [path.name for path in (data / "trash").iterdir()] == ["by-hand.bin"]


def test_what_is_unfinished_is_listed_and_removed_by_the_next_import(
    episode_id, data, tmp_path, say
):
    """The leftovers are those of a killed import, and parts without their recording."""
    left = data / NAME
    (left / "gone.parts").mkdir()
    for name, size in (("tub.mcap", 0), (".tub.mcap.4711.part", 69_000)):
        (left / name).write_bytes(bytes(size))
        os.utime(left / name, (1.0, 1.0))
    (left / ".new.mcap.4712.part").write_bytes(b"on its way")
    said = say("episodes list")
    assert "gone.parts, 0.0 MB: gone.mcap is missing" in said
    assert "unfinished: episodes/tub.mcap, 0.0 MB" in said
    assert "unfinished: episodes/.tub.mcap.4711.part, 0.1 MB" in said
    assert "4712" not in said
    say(f"episodes import {tmp_path / 'nothing'}", status=2)
    kept = {"gone.parts", f"{episode_id}.mcap", ".new.mcap.4712.part"}
    assert {path.name for path in left.iterdir()} == kept
