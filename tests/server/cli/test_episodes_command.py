"""`drivelesson episodes` and `drivelesson learn`, as a user types them."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from robot.store.episodes.episode import Episode
from robot.store.episodes.store import EpisodeStore
from robot.store.folder import Storage
from robot.store.models.store import ModelStore
from robot.types import Frame
from server.__main__ import main
from tests.robot.store.episodes.drives import record_drive


@pytest.fixture
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DRIVELESSON_DATA", str(tmp_path / "data"))
    return tmp_path / "data"


@pytest.fixture
def episode_id(data: Path) -> str:
    return record_drive(Storage(data).episodes, "default-8").id


def say(words: str, capsys: pytest.CaptureFixture[str], status: int = 0) -> str:
    assert main(words.split()) == status
    captured = capsys.readouterr()
    return captured.out if status == 0 else captured.err


@pytest.mark.parametrize(
    "words",
    [
        *("episodes compact last", "episodes title last x", "learn last --out m"),
        *("episodes export last --as folder", "episodes import OUT/mine --name again"),
    ],
)
def test_a_full_disk_is_told_in_a_sentence_and_nothing_is_lost(
    episode_id: str,
    data: Path,
    tmp_path: Path,
    words: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    say(f"episodes export last --as folder --out {tmp_path}/mine", capsys)
    before = {path: path.read_bytes() for path in data.rglob("*.*") if path.is_file()}

    def refuse(self: object, *_: object) -> None:
        raise OSError(28, "No space left on device")

    for name in ("robot.store.folder.os.fsync", "pathlib.Path.write_bytes"):
        monkeypatch.setattr(name, refuse)
    told = say(words.replace("OUT", str(tmp_path)), capsys, status=1)
    assert told.splitlines()[-1].endswith("No space left on device")
    assert "Traceback" not in told
    assert {path: path.read_bytes() for path in data.rglob("*.*") if path.is_file()} == before


def test_models_among_recordings_are_named_and_hold_up_nothing(
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
    say(f"episodes import {folder} --strict", capsys, status=1)
    (folder / "b.npz").unlink()
    assert "no drive to use" in say(f"episodes import {folder}", capsys, status=1)


def test_list_and_show(episode_id: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert episode_id in say("episodes list", capsys)
    shown = say("episodes show last", capsys)
    assert "'forward': 20, 'left': 20, 'right': 20" in shown
    pilot = next(line for line in shown.splitlines() if line.startswith("pilot"))
    assert "FFFFLLLLRRRR" in pilot


def test_before_anything_is_recorded_that_is_said(
    data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "nothing is recorded yet" in say("episodes show last", capsys, status=1)


def test_mend_and_undo(episode_id: str, data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = EpisodeStore(Storage(data))
    assert "1 edit; " in say("episodes trim last --from 0.5 --to 2.5", capsys)
    assert "it was edited" in say("learn last --check", capsys, status=1)
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
    say("episodes restore", capsys, status=1)


def test_the_budget_offers_and_deletes_nothing(
    episode_id: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert f"could go: {episode_id}" in say("episodes budget --gigabytes 0", capsys)
    say("episodes protect last", capsys)
    assert "could go" not in say("episodes budget --gigabytes 0", capsys)
    assert episode_id in say("episodes list", capsys)


def test_learn_gives_the_nodes_of_driving_and_saves_them(
    episode_id: str, data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told = say("learn last --check --out again", capsys)
    assert "the same nodes as driving made" in told
    model = ModelStore(Storage(data)).load("again")
    assert (model.summary.learner, model.summary.n_examples) == ("default-8", 60)
    say(f"learn {episode_id} --learner published --max-nodes 64 --out {tmp_path}/m.npz", capsys)
    assert (tmp_path / "m.npz").stat().st_size > 1000


@pytest.mark.parametrize("form", ["tub", "folder", "npz"])
def test_out_and_in_again(
    episode_id: str, data: Path, form: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out = data / f"exports/drive.{form}"
    say(f"episodes export last --as {form} --out {out}", capsys)
    say(f"episodes import {out} --name back", capsys)
    say("learn back --learner default --max-nodes 8 --out back", capsys)
    assert ModelStore(Storage(data)).load("back").summary.n_examples == 60


@pytest.mark.parametrize("form", ["tub", "film", "npz"])
def test_an_export_that_ends_in_an_error_is_not_there(
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
    assert main(f"episodes export last --as {form}".split()) == 1
    assert len(seen) == 9 and not any((data / "exports").iterdir())


def test_tubs_in_a_zip_are_imported_each_or_with_strict_none(
    episode_id: str, data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("one!", "two"):
        say(f"episodes export last --as folder --out {tmp_path}/drives/{name}", capsys)
        say(f"episodes export last --as tub --out {tmp_path}/drives/tub-{name}", capsys)
    next((tmp_path / "drives/two/images").iterdir()).write_bytes(b"")
    archive = shutil.make_archive(str(tmp_path / "all"), "zip", tmp_path / "drives")
    assert "is not a picture" in say(f"episodes import {archive} --strict", capsys, status=1)
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


def test_an_import_without_times_is_not_the_last_recording(
    episode_id: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    say(f"episodes export last --as folder --out {tmp_path}/out", capsys)
    say(f"episodes import {tmp_path}/out --name zzz", capsys)
    assert say("episodes show last", capsys) == say(f"episodes show {episode_id}", capsys)
    assert "unknown" in say("episodes list", capsys)


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
        ("episodes show nobody", "no episode of this name"),
        ("episodes trim last --from 90 --to 91", "no pictures between"),
        ("episodes export last --as tub --out /proc/x", "cannot write"),
        ("episodes import /nowhere", "nowhere does not exist"),
        ("board --robots /nowhere/robots.txt", "robots.txt: No such file"),
        ("episodes import /nowhere --threshold 7", "--threshold"),
        ("learn last --learner oracle", "oracle"),
        ("learn nobody", "no episode of this name"),
        ("episodes restore 17", "no longer in the trash"),
        ("episodes list --data /proc/x", "cannot be used"),
    ],
)
def test_what_cannot_be_done_is_one_clear_line(
    episode_id: str, words: str, complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    told = say(words, capsys, status=1)
    assert complaint in told.splitlines()[-1]
