"""`drivelesson episodes export` and `import`, as a user types them."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

import pytest

from robot.exchange.drive import write_episode
from robot.exchange.sources import Source, find_drives
from robot.recordings.episode import Episode
from robot.recordings.store import EpisodeStore
from robot.store.folder import Storage
from robot.store.models.store import ModelStore
from robot.store.prepare import prepare
from robot.types import Frame, Mode
from server.__main__ import main
from tests.robot.recordings.drives import RecordedBench
from tests.server.cli.typed import assert_refused_by_a_full_disk, say


@pytest.mark.parametrize(
    "words", ["episodes export last --as folder", "episodes import OUT/mine --name again"]
)
def test_a_full_disk_is_reported_in_a_sentence_and_nothing_is_lost(
    episode_id: str,
    data: Path,
    tmp_path: Path,
    words: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    say(f"episodes export last --as folder --out {tmp_path}/mine", capsys)
    assert_refused_by_a_full_disk(words.replace("OUT", str(tmp_path)), data, monkeypatch, capsys)


def test_models_among_recordings_are_reported_and_do_not_stop_an_import(
    episode_id: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "drives"
    folder.mkdir()
    say(f"episodes export last --as npz --out {folder}/b.npz", capsys)
    say(f"learn last --out {folder}/a-model.npz", capsys)
    (folder / "c.npz").write_bytes(b"no archive")
    told = say(f"episodes import {folder}", capsys)
    assert "b: 60 pictures from b.npz (npz)" in told and "skipped: 2" in told
    for name, why in (("a-model.npz", "jpeg"), ("c.npz", "cannot be read")):
        line = next(line for line in told.splitlines() if name in line)
        assert why in line
    say(f"episodes import {folder} --strict", capsys, status=2)
    (folder / "b.npz").unlink()
    assert "no drive to use" in say(f"episodes import {folder}", capsys, status=2)


@pytest.mark.parametrize("form", ["tub", "folder", "npz"])
def test_an_exported_episode_can_be_imported_again(
    episode_id: str, data: Path, form: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out = data / f"exports/drive.{form}"
    say(f"episodes export last --as {form} --out {out}", capsys)
    say(f"episodes import {out} --name back", capsys)
    say("learn back --learner default --max-nodes 8 --out back", capsys)
    assert ModelStore(Storage(data)).load("back").summary.n_examples == 60


@pytest.mark.parametrize("form", ["tub", "film", "npz"])
def test_an_export_that_fails_leaves_no_file(
    episode_id: str, data: Path, form: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if form == "film":
        pytest.importorskip("av", reason="NOT TESTED: PyAV is not installed (the extra export)")
    seen: list[int] = []

    def read_some(episode: Episode, frame_id: int) -> Frame:
        seen.append(frame_id)
        if len(seen) == 9:
            raise OSError("the disk is full")
        return read(episode, frame_id)

    read = Episode.frame
    monkeypatch.setattr(Episode, "frame", read_some)
    assert main(f"episodes export last --as {form}".split()) in (1, 2)
    assert len(seen) == 9 and not any((data / "exports").iterdir())


def test_tubs_in_a_zip_are_imported_each_or_with_strict_none(
    episode_id: str, data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("one!", "two"):
        say(f"episodes export last --as folder --out {tmp_path}/drives/{name}", capsys)
        say(f"episodes export last --as tub --out {tmp_path}/drives/tub-{name}", capsys)
    next((tmp_path / "drives/two/images").iterdir()).write_bytes(b"")
    archive = shutil.make_archive(str(tmp_path / "all"), "zip", tmp_path / "drives")
    assert "is not a picture" in say(f"episodes import {archive} --strict", capsys, status=2)
    assert EpisodeStore(Storage(data)).ids() == [episode_id]
    assert not any(path.is_dir() for path in (data / "episodes").iterdir())
    told = say(f"episodes import {archive}", capsys)
    assert "60 pictures from two" in told and "skipped: 1" in told
    assert set(EpisodeStore(Storage(data)).ids()) == {
        episode_id,
        "one",
        "two",
        "tub-one",
        "tub-two",
    }


def test_neither_a_starting_server_nor_emptying_the_trash_disturbs_an_import(
    episode_id: str,
    data: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    say(f"episodes export last --as folder --out {tmp_path}/drives/one", capsys)
    archive = shutil.make_archive(str(tmp_path / "all"), "zip", tmp_path / "drives")
    moved: list[tuple[str, str]] = []

    def find_later(path: Path) -> list[Source]:
        moved.extend(prepare(data))
        assert main(["episodes", "empty-trash"]) == 0
        return find_drives(path)

    killed = data / "trash/.import-killed/one"
    killed.mkdir(parents=True)
    (killed.parent / ".lock").touch()
    monkeypatch.setattr("server.exchange.command.find_drives", find_later)
    assert "61 pictures from one" in say(f"episodes import {archive}", capsys)
    assert moved == [] and not any((data / "trash").iterdir())


def test_an_import_without_times_does_not_count_as_the_last_recording(
    episode_id: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    say(f"episodes export last --as folder --out {tmp_path}/out", capsys)
    say(f"episodes import {tmp_path}/out --name zzz", capsys)
    assert say("episodes show last", capsys) == say(f"episodes show {episode_id}", capsys)
    assert "unknown" in say("episodes list", capsys)


def test_two_imports_of_one_name_at_once_lose_nothing(
    episode_id: str,
    data: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    say(f"episodes export last --as folder --out {tmp_path}/out", capsys)
    words = f"episodes import {tmp_path}/out --name Hall"
    meanwhile = [words, words.replace("Hall", "hall"), "episodes list"]

    def write_slowly(*what: Any, **more: Any) -> int:
        while meanwhile:
            assert main(meanwhile.pop(0).split()) == 0
        return write_episode(*what, **more)

    monkeypatch.setattr("server.exchange.command.write_episode", write_slowly)
    assert "damaged" not in say(words, capsys)
    store = EpisodeStore(Storage(data))
    assert set(store.ids()) == {episode_id, "Hall", "Hall (2)", "hall (3)"}
    assert all(len(store.open(name).frames) == 61 for name in store.ids())


def test_a_name_is_free_again_when_an_import_fails(
    episode_id: str, data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    say(f"episodes export last --as folder --out {tmp_path}/out", capsys)
    images = list((tmp_path / "out/images").iterdir())
    kept = {path: path.read_bytes() for path in images}
    for path in images:
        path.write_bytes(b"")
    say(f"episodes import {tmp_path}/out --name hall", capsys, status=2)
    for path, content in kept.items():
        path.write_bytes(content)
    assert say(f"episodes import {tmp_path}/out --name hall", capsys).startswith("hall: ")
    assert len(list((data / "episodes").iterdir())) == 2


def record_pause(data: Path) -> None:
    """Record a drive with a gap of 65 s in the middle, in which nobody taught."""
    robot = RecordedBench(Storage(data).folder("episodes"))
    robot.drive(range(8))
    robot.start(Mode.AUTONOMOUS, 0)
    for number in range(1300):
        robot.step(number % 8, None)
    robot.stop()
    robot.drive(range(8))
    robot.finish()


def test_remarks_about_times_concern_only_the_pictures_that_were_written(
    data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record_pause(data)
    told = say("episodes export last --as npz", capsys)
    assert told.endswith("times repaired: 1 pauses of up to 65 s shortened to 2 s\n")


def test_films_and_datasets_report_a_shortened_pause(
    data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record_pause(data)
    say("episodes delete last --from 0.5 --to 65.5", capsys)
    assert "1 pauses of up to 65 s" in say("episodes export last --as lerobot --fps 1", capsys)


def test_films_and_datasets_go_to_the_exports(
    episode_id: str, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    say("episodes export last --as film", capsys)
    say("episodes export last --as lerobot --fps 10", capsys)
    names = sorted(path.name for path in (data / "exports").iterdir())
    assert names == [f"{episode_id}-film.mp4", f"{episode_id}-lerobot"]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("episodes export last --as tub --out /proc/x", "cannot write"),
        ("episodes export last --as folder --fps 5 --task x", "--as folder takes no --fps, --task"),
        ("episodes export last --as film --all", "--as film takes no --all; leave it out"),
        ("episodes export last --as tub --task x", "--as tub takes no --task"),
        ("episodes import /nowhere --name a/b", "'a/b' is not a valid name"),
        ("episodes import /nowhere", "nowhere does not exist"),
        ("episodes import /nowhere --threshold 7", "--threshold"),
    ],
)
def test_what_cannot_be_done_is_one_clear_line(
    episode_id: str, words: str, complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert complaint in say(words, capsys, status=2).splitlines()[-1]


def test_with_the_option_all_a_tub_also_has_untaught_pictures(
    data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot = RecordedBench(Storage(data).folder("episodes"))
    robot.drive(range(8))
    robot.start(Mode.AUTONOMOUS, 0)
    robot.step(1, None)
    robot.stop()
    robot.finish()
    assert ": 8 records" in say("episodes export last --as tub", capsys)
    assert ": 8 records" not in say("episodes export last --as tub --all", capsys)
    assert main(["episodes", "export", "last", "--as", "tub"]) == 0
    assert "100%" in capsys.readouterr().err, "what is left out is done, too"


@pytest.mark.skipif(os.name == "nt", reason="some of these are no names there")
@pytest.mark.parametrize("name", ["aux", "nul.2", "---", "\U00020000" * 60])
def test_a_folder_of_any_name_is_imported(
    episode_id: str, tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    say(f"episodes export last --as folder --out {tmp_path}/{name}", capsys)
    told = say(f"episodes import {tmp_path}/{name}", capsys)
    assert told.startswith("import: ") and f" pictures from {name} (folder)" in told
