"""`drivelesson episodes export`, `import` and `play`, as a user types them."""

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from robot.exchange.drive import write_episode
from robot.exchange.sources import Source, find_drives
from robot.recordings.episode import Episode
from robot.recordings.store import EpisodeStore
from robot.store.folder import Storage
from robot.store.prepare import prepare
from robot.types import Frame, Mode
from server.__main__ import main
from tests.kit.run import run
from tests.robot.recordings.drives import RecordedBench


@pytest.fixture
def exported(episode_id, tmp_path, say):
    """The data folder's recording, exported as a folder of pictures."""
    say(f"episodes export last --as folder --out {tmp_path}/out")
    return tmp_path / "out"


def test_models_among_recordings_are_reported_and_do_not_stop_an_import(episode_id, tmp_path, say):
    folder = tmp_path / "drives"
    folder.mkdir()
    say(f"episodes export last --as npz --out {folder}/b.npz")
    say(f"learn last --out {folder}/a-model.npz")
    (folder / "c.npz").write_bytes(b"no archive")
    told = say(f"episodes import {folder}")
    assert "b: 60 pictures from b.npz (npz)" in told and "skipped: 2" in told
    for name, why in (("a-model.npz", "jpeg"), ("c.npz", "cannot be read")):
        line = next(line for line in told.splitlines() if name in line)
        assert why in line
    say(f"episodes import {folder} --strict", status=2)
    (folder / "b.npz").unlink()
    assert "found no drive to import" in say(f"episodes import {folder}", status=2)


def test_tubs_in_a_zip_are_imported_each_or_with_strict_none(episode_id, data, tmp_path, say):
    for name in ("one!", "two"):
        say(f"episodes export last --as folder --out {tmp_path}/drives/{name}")
        say(f"episodes export last --as tub --out {tmp_path}/drives/tub-{name}")
    next((tmp_path / "drives/two/images").iterdir()).write_bytes(b"")
    archive = shutil.make_archive(str(tmp_path / "all"), "zip", tmp_path / "drives")
    assert "is not a picture" in say(f"episodes import {archive} --strict", status=2)
    store = EpisodeStore(Storage(data))
    assert store.ids() == [episode_id]
    assert not any(path.is_dir() for path in (data / "episodes").iterdir())
    told = say(f"episodes import {archive}")
    assert "60 pictures from two" in told and "skipped: 1" in told
    assert set(store.ids()) == {episode_id, "one", "two", "tub-one", "tub-two"}


def test_neither_a_starting_server_nor_emptying_the_trash_disturbs_an_import(
    exported, data, tmp_path, monkeypatch, say
):
    archive = shutil.make_archive(str(tmp_path / "all"), "zip", exported)
    moved: list[tuple[str, str]] = []

    def find_later(path: Path) -> list[Source]:
        moved.extend(prepare(data))
        assert main(["episodes", "empty-trash"]) == 0
        return find_drives(path)

    killed = data / "trash/.import-killed/one"
    killed.mkdir(parents=True)
    (killed.parent / ".lock").touch()
    monkeypatch.setattr("server.exchange.command.find_drives", find_later)
    assert "61 pictures from all" in say(f"episodes import {archive}")
    assert moved == [] and not any((data / "trash").iterdir())


def test_an_import_without_times_does_not_count_as_the_last_recording(episode_id, exported, say):
    say(f"episodes import {exported} --name zzz")
    assert say("episodes show last") == say(f"episodes show {episode_id}")
    assert "unknown" in say("episodes list")


def test_two_imports_of_one_name_at_once_lose_nothing(episode_id, exported, data, monkeypatch, say):
    words = f"episodes import {exported} --name Hall"
    meanwhile = [words, words.replace("Hall", "hall"), "episodes list"]

    def write_slowly(*what: Any, **more: Any) -> int:
        while meanwhile:
            assert main(meanwhile.pop(0).split()) == 0
        return write_episode(*what, **more)

    monkeypatch.setattr("server.exchange.command.write_episode", write_slowly)
    assert "damaged" not in say(words)
    store = EpisodeStore(Storage(data))
    assert set(store.ids()) == {episode_id, "Hall", "Hall (2)", "hall (3)"}
    assert all(len(store.open(name).frames) == 61 for name in store.ids())


def test_a_name_is_free_again_when_an_import_fails(exported, data, say):
    images = list((exported / "images").iterdir())
    kept = {path: path.read_bytes() for path in images}
    for path in images:
        path.write_bytes(b"")
    say(f"episodes import {exported} --name hall", status=2)
    for path, content in kept.items():
        path.write_bytes(content)
    assert say(f"episodes import {exported} --name hall").startswith("hall: ")
    assert len(list((data / "episodes").iterdir())) == 2


def test_an_export_says_how_much_and_which_times_it_wrote(data, say, capsys, monkeypatch):
    """Between two lessons the robot drives by itself for 5 s; only `--all` exports that part."""
    monkeypatch.setattr("robot.exchange.timeline._LONGEST_PAUSE_S", 4.0)
    robot = RecordedBench(Storage(data).folder("episodes"))
    robot.drive(range(8))
    robot.start(Mode.AUTONOMOUS, 0)
    for number in range(100):
        robot.step(number % 8, None)
    robot.stop()
    robot.drive(range(8))
    robot.finish()
    told = say("episodes export last --as npz")
    assert told.endswith("times repaired: 1 pauses of up to 5 s shortened to 2 s\n")
    assert ": 16 records" in say("episodes export last --as tub")
    assert ": 16 records" not in say("episodes export last --as tub --all")
    assert main(["episodes", "export", "last", "--as", "tub"]) == 0
    assert "100%" in capsys.readouterr().err, "frames that are left out count as done, too"


def test_films_and_datasets_go_to_the_exports(episode_id, data, say):
    say("episodes export last --as film")
    say("episodes export last --as lerobot --fps 10")
    names = sorted(path.name for path in (data / "exports").iterdir())
    assert names == [f"{episode_id}-film.mp4", f"{episode_id}-lerobot"]


@pytest.mark.parametrize("form", ["tub", "film", "npz"])
def test_an_export_that_fails_leaves_no_file(episode_id, data, form, monkeypatch):
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


def test_an_export_under_a_wrong_name_is_refused_before_anything_is_read(
    episode_id, monkeypatch, say
):
    def refuse(*_: object) -> None:
        raise AssertionError("the file must not be read")

    monkeypatch.setattr("server.recordings.selection.open_episode", refuse)
    for words in (
        "--as film --out cinema",
        "--as npz --out hall_A",
        "--as npz --fps 3",
        "--as tub --out .",
    ):
        assert say(f"episodes export last {words}", status=2)


PLAY = [sys.executable, "-m", "server", "episodes", "play"]


@pytest.mark.slow
def test_a_recording_is_played_into_a_page(episode_id, data):
    words = [*PLAY, episode_id, "--port", "0", "--data", str(data)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as playing:
        try:
            assert any("Drivelesson is ready: open http" in line for line in playing.stdout)
        finally:
            playing.terminate()


def test_a_file_that_is_not_a_recording_is_reported(data, tmp_path):
    (tmp_path / "broken.mcap").write_bytes(b"no recording")
    data.mkdir()
    played = run(*PLAY, tmp_path / "broken.mcap", "--port", "0", "--data", data)
    assert (played.returncode, played.stdout) == (2, "")
    said = "drivelesson: broken.mcap cannot be read: broken.mcap is not an MCAP file"
    assert played.stderr.splitlines()[-1] == said
