"""A long recording consists of several files, and is one episode for every user."""

from __future__ import annotations

import contextlib
import gc
import io
import shutil
import tracemalloc
import zipfile
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from robot.exchange.drive import ImportReport
from robot.exchange.sources import find_drives
from robot.policy.events import Taught, describe_event
from robot.recordings.archive import join_recording, zip_recordings
from robot.recordings.config import RecorderConfig
from robot.recordings.editing import sample
from robot.recordings.edits import Edit, Notes, notes_path
from robot.recordings.ending import end_recording
from robot.recordings.episode import Episode, open_episode, taught_frames
from robot.recordings.folder import NAME
from robot.recordings.marks import FrameMarks
from robot.recordings.messages import Topic
from robot.recordings.open_recording import OpenRecording
from robot.recordings.parts import part_paths
from robot.recordings.reader import CUT_SHORT, Block, walk
from robot.recordings.recorder import RecordingQueue
from robot.recordings.rejoining import rejoin, strays
from robot.recordings.store import EpisodeStore
from robot.recordings.summary import read_summary
from robot.recordings.writer import describe_run
from robot.store.disk import no_announcement
from robot.store.folder import Storage
from robot.store.prepare import ASIDE, prepare
from robot.testing import VirtualClock
from robot.types import Action, Example, Mode
from tests.kit.frames import jpeg_frame
from tests.kit.sizes import size

from .drives import RecordedBench, content

MANY = 10**6


def drive(folder: Path, **limits: float) -> RecordedBench:
    """Drive through 80 pictures, undo examples around the beginning of a part, and drive on."""
    folder.mkdir(exist_ok=True)
    robot = RecordedBench(folder, **limits)
    robot.clock.set_wall(1_700_000_000)
    robot.drive(range(80))
    robot.undo(1.5)
    robot.drive(range(80, 120))
    return robot


def told(episode: Episode) -> dict[str, Any]:
    models = [model for model in (episode.model_before(), episode.model_after()) if model]
    counts = [model.summary.n_examples for model in models]
    return content(episode) | {"some": sample(episode, Notes(), 7), "models": counts}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recording of the drive in one file."""
    return drive(tmp_path_factory.mktemp("whole")).finish()[0]


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with a recording in several files, which no test may change."""
    return drive(tmp_path_factory.mktemp("driven"), part_s=1.0).finish()[0].parent


def stored(root: Path, driven: Path) -> tuple[EpisodeStore, str]:
    """Return a data folder with the recording in several files, which has a title, and its name."""
    storage = Storage(root)
    shutil.copytree(driven, storage.folder(NAME), dirs_exist_ok=True)
    store = EpisodeStore(storage)
    [episode_id] = store.ids()
    store.set_title(episode_id, "long")
    return store, episode_id


@pytest.fixture
def store(tmp_path: Path, driven: Path) -> EpisodeStore:
    return stored(tmp_path, driven)[0]


@pytest.fixture
def path(store: EpisodeStore) -> Path:
    """The recording in several files, which may be changed."""
    return store.path(store.ids()[0])


def test_a_recording_in_parts_equals_one_in_a_single_file(
    whole: Path, store: EpisodeStore, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert len(part_paths(path)) >= 5
    wanted = told(open_episode(whole))
    assert told(open_episode(path)) == wanted
    assert len(wanted["taught"]) < 120, "examples were undone"
    [summary], single = store.summaries(), read_summary(whole)
    assert (summary.frames, summary.taught) == (single.frames, single.taught)
    assert summary.duration_s == single.duration_s and summary.damage is None
    assert summary.bytes == sum(file.stat().st_size for file in part_paths(path).values())
    monkeypatch.setattr("robot.recordings.episode.read_columns", lambda _: None)
    assert told(open_episode(path)) == wanted, "the parts read the same without their indexes"


def test_every_file_is_read_by_the_library(store: EpisodeStore, path: Path) -> None:
    frames = 0
    for file in part_paths(path).values():
        with file.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True)
            frames += sum(1 for _ in reader.iter_messages(topics=["/camera"]))
    assert frames == store.summaries()[0].frames


def joined(path: Path, folder: Path) -> Path:
    target = folder / path.name
    with target.open("wb") as file:
        join_recording(file.write, path)
    return target


def imported(path: Path, folder: Path) -> Path:
    [source], report, given = find_drives(path.parent), ImportReport(), open_episode(path)
    assert source.copy is not None
    assert source.copy(folder / path.name, report) == len(given.frames)
    assert sum(report.labels.values()) == len(taught_frames(given)) > 0
    copied = open_episode(folder / path.name).run
    assert copied == {**given.run, "source": "recording of another robot"}
    return folder / path.name


def zipped(path: Path, folder: Path) -> Path:
    with zipfile.ZipFile(io.BytesIO(b"".join(zip_recordings([path])))) as archive:
        archive.extractall(folder)
    assert notes_path(folder / path.name).is_file()
    return folder / path.name


@pytest.mark.parametrize("way", [joined, imported, zipped])
def test_a_copy_has_the_content_of_all_files(
    path: Path, tmp_path: Path, way: Callable[[Path, Path], Path]
) -> None:
    (tmp_path / "other").mkdir()
    copy = way(path, tmp_path / "other")
    assert told(open_episode(copy)) == told(open_episode(path))
    assert read_summary(copy).taught == read_summary(path).taught


def test_a_start_moves_no_file_of_a_recording(
    store: EpisodeStore, path: Path, tmp_path: Path
) -> None:
    wanted = told(open_episode(path))
    (path.with_suffix(".parts") / "9.mcap").mkdir()
    path.with_name("other.parts").touch()
    names = ["9.mcap", "other.parts"]
    assert sorted(prepare(tmp_path)) == [(name, f"set-aside/{name}.1") for name in names]
    assert prepare(tmp_path) == [] and told(open_episode(path)) == wanted
    path.with_suffix(".parts").rename(tmp_path / ASIDE / f"{path.stem}.parts.1")  # an old version
    rejoin(Storage(tmp_path))
    assert told(open_episode(path)) == wanted


@pytest.fixture
def left(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The number of files that the program moves before it is killed; the test sets the number."""
    left = [MANY]

    def moving(one: Path, target: Path) -> None:
        left[0] -= 1
        if left[0] < 0:
            raise KeyboardInterrupt
        one.replace(target)

    monkeypatch.setattr("robot.store.folder.move", moving)
    return left


@pytest.mark.parametrize("is_taken", [False, True])
def test_a_kill_separates_no_files_of_a_recording(
    driven: Path, tmp_path: Path, left: list[int], is_taken: bool
) -> None:
    """If moves of a deletion or restoration are missing, the recording is in the list or trash."""
    for is_restored, kept in product((False, True), range(4)):
        root = tmp_path / f"{is_restored}{kept}"
        store, episode_id = stored(root, driven)
        wanted = list(store.open(episode_id).frames)
        left[0] = MANY if is_restored else kept
        with contextlib.suppress(KeyboardInterrupt):
            key = store.delete(episode_id).key or ""
            left[0] = kept
            if is_taken:
                shutil.copy(driven / f"{episode_id}.mcap", root / NAME)
            store.restore(key)
        left[0] = MANY
        rejoin(Storage(root))
        assert not list(strays(root / NAME))
        titled = [one.id for one in store.summaries() if one.title == "long"]
        [found] = titled or store.restore(max(store.trash()))
        assert list(store.open(found).frames) == wanted and store.notes(found).title == "long"
        assert store.trash() == []


def test_a_kill_while_it_is_made_compact_loses_nothing(
    driven: Path, tmp_path: Path, left: list[int]
) -> None:
    for kept in range(6):  # moves: mark, first file, notes, parts, new file and its notes
        root = tmp_path / str(kept)
        store, episode_id = stored(root, driven)
        wanted = list(store.open(episode_id).frames)
        store.edit(episode_id, Edit(verb="delete", ranges=((wanted[3], wanted[9]),)))
        left[0] = kept
        with pytest.raises(KeyboardInterrupt):
            store.compact(episode_id)
        left[0] = MANY
        rejoin(Storage(root))
        assert (store.ids(), store.notes(episode_id).title) == ([episode_id], "long")
        is_compact = kept == 5
        assert len(store.notes(episode_id).edits) == 1 - is_compact
        assert list(store.open(episode_id).frames) == wanted[:3] + wanted[3 + 7 * is_compact :]
        assert len(store.trash()) == is_compact
        assert not list(root.rglob("*.0.part"))


def test_edits_compacting_and_splitting_cover_all_files(store: EpisodeStore) -> None:
    [episode_id] = store.ids()
    episode = store.open(episode_id)
    ids = [int(one) for one in episode.frames]
    second = store.split(episode_id, ids[70])
    assert list(store.open(second).frames) == ids[70:]
    store.edit(episode_id, Edit(verb="delete", ranges=((ids[30], ids[40]),)))
    key = store.compact(episode_id)
    compacted = store.open(episode_id)
    assert list(compacted.frames) == ids[:30] + ids[41:70]
    assert list(part_paths(compacted.path)) == [0]
    [restored] = store.restore(key)
    assert list(store.open(restored).frames) == ids


def test_a_discarded_drive_leaves_no_file(tmp_path: Path) -> None:
    robot = RecordedBench(tmp_path, part_s=1.0, keeps_drives=False)
    robot.drive(range(60), Mode.AUTONOMOUS)
    assert list(tmp_path.glob("*.parts"))
    assert robot.finish() == [] and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("left", [0, 4, 300, None])
def test_a_power_cut_in_a_part_costs_only_what_was_not_synced(path: Path, left: int | None) -> None:
    """The last part is missing or empty, or is truncated in its header or last chunk."""
    last, whole = list(part_paths(path).values())[-1], open_episode(path)
    data, chunks = last.read_bytes(), [part for part in walk(last) if isinstance(part, Block)]
    last.unlink()
    wanted = set(open_episode(path).frames)
    assert open_episode(path).damage == read_summary(path).damage == CUT_SHORT
    last.write_bytes(data[: chunks[-1].offset + 50 if left is None else left])
    found = open_episode(path)
    assert set(found.frames) >= wanted and found.damage == CUT_SHORT
    end_recording(path)
    again, summary = open_episode(path), read_summary(path)
    assert list(again.frames) == list(found.frames) and again.damage == CUT_SHORT
    assert dict(taught_frames(again)) == dict(taught_frames(found))
    assert (summary.frames, summary.damage) == (len(found.frames), CUT_SHORT)
    assert sum(summary.taught.values()) == len(taught_frames(found)) < len(taught_frames(whole))
    assert not end_recording(path)


@pytest.mark.parametrize("gone", [1, 2])
def test_a_missing_or_foreign_part_is_named_and_the_others_are_read(
    path: Path, tmp_path: Path, gone: int
) -> None:
    [other] = drive(tmp_path / "other", part_s=1.0).finish()
    file, frames = part_paths(path)[gone], len(open_episode(path).frames)
    file.unlink()
    episode = open_episode(path)
    assert episode.damage == f"part {gone} is missing" == read_summary(path).damage
    assert 0 < len(episode.frames) < frames
    file.write_bytes(part_paths(other)[gone].read_bytes())
    assert "another recording" in str(open_episode(path).damage)
    assert list(open_episode(path).frames) == list(episode.frames)


def test_the_recorder_keeps_nothing_of_earlier_parts(tmp_path: Path) -> None:
    """`kept` has the recorder's bytes in memory; a page of marks covers 4096 frame ids."""
    clock = VirtualClock()
    config = RecorderConfig(spare_bytes=0, part_s=10.0)
    recording = OpenRecording(
        tmp_path, config, lambda path: path.open("xb"), no_announcement, clock
    )
    queue = RecordingQueue(recording, config)
    queue.begin(describe_run(episode_id="long", run_id="r", origin_ns=10**18), None)
    taught, kept = FrameMarks(), []
    tracemalloc.start()
    try:
        for number in range(1, size("PICTURES", 1500, 9000)):
            clock.sleep(0.1)
            now_s, frame_id = clock.now_s(), 100 * number
            example = Example(frame_id=frame_id, label=Action.LEFT, is_intervention=False)
            event = Taught(example=example, x=np.zeros(0), at_s=now_s)
            taught.set_taught(frame_id, 1, now_s)
            queue.write_frame(jpeg_frame(frame_id, now_s, bytes(300)))
            queue.write_messages(now_s, lambda event=event: [(Topic.LESSON, describe_event(event))])
            if number % 20 == 0:
                queue.write_waiting()
                if number % 100 == 0:
                    gc.collect()
                    kept.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
        queue.end(None, is_kept=True)
        queue.write_waiting()
    assert len(part_paths(tmp_path / "long.mcap")) > 10
    third = len(kept) // 3
    growth = max(kept[2 * third :]) - max(kept[third : 2 * third])
    assert growth < 40_000, "only the marks of the current part stay in memory, five pages at most"
