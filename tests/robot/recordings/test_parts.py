"""A long recording consists of several files, and is one episode for every user."""

from __future__ import annotations

import contextlib
import gc
import io
import shutil
import tracemalloc
import zipfile
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pytest

from robot.exchange.drive import ImportReport
from robot.exchange.sources import find_drives
from robot.policy.history import Taught
from robot.recordings.archive import join_recording, zip_recordings
from robot.recordings.editing import moments, sample
from robot.recordings.edits import Edit, Notes, notes_path
from robot.recordings.ending import end_recording
from robot.recordings.episode import Episode, open_episode, taught_frames
from robot.recordings.folder import NAME
from robot.recordings.marks import FrameMarks
from robot.recordings.messages import Topic
from robot.recordings.parts import part_paths
from robot.recordings.queue import RecorderConfig, RecordingQueue
from robot.recordings.reader import CUT_SHORT, Block, walk
from robot.recordings.rejoining import rejoin, strays
from robot.recordings.store import EpisodeStore
from robot.recordings.summary import read_summary
from robot.recordings.teaching import learn_again
from robot.recordings.writer import describe_run
from robot.store.disk import no_announcement
from robot.store.folder import Storage
from robot.store.models.events import describe_event
from robot.store.models.model import same_nodes
from robot.store.prepare import ASIDE, prepare
from robot.testing import VirtualClock
from robot.types import Action, Example, Mode
from tests.kit.frames import jpeg_frame
from tests.kit.sizes import size

from .drives import RecordedBench

MANY = 10**6
WHOLE = RecorderConfig(spare_bytes=0)
SHORT = RecorderConfig(spare_bytes=0, part_s=1.0)


def drive(folder: Path, config: RecorderConfig) -> RecordedBench:
    """Drive through 80 pictures, undo lessons on both sides of a part's beginning, and drive on."""
    folder.mkdir(exist_ok=True)
    robot = RecordedBench(folder, config=config)
    robot.clock.set_wall(1_700_000_000)
    robot.drive(range(80))
    robot.loop.submit(lambda: robot.loop.history.undo(1.5))
    robot.tick()
    robot.drive(range(80, 120))
    return robot


def told(episode: Episode) -> dict[str, Any]:
    """Return the content of a recording."""
    ids, notes = list(episode.frames), Notes()
    models = [model for model in (episode.model_before(), episode.model_after()) if model]
    return {
        "moments": list(moments(episode, notes)),
        "taught": dict(taught_frames(episode)),
        "events": [(at_s, type(event)) for at_s, event in episode.events],
        "pictures": [episode.frame(frame_id).data for frame_id in ids],
        "some": sample(episode, notes, 7),
        "modes": list(episode.messages(Topic.MODE)),
        "duration_s": episode.duration_s,
        "damage": episode.damage,
        "models": [model.summary.n_examples for model in models],
    }


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    [path] = drive(tmp_path_factory.mktemp("whole"), WHOLE).finish()
    return path


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with a recording in several files; do not change it."""
    [path] = drive(tmp_path_factory.mktemp("driven"), SHORT).finish()
    return path.parent


@pytest.fixture
def store(tmp_path: Path, driven: Path) -> EpisodeStore:
    """A data folder with one recording in several files."""
    storage = Storage(tmp_path)
    shutil.copytree(driven, storage.folder(NAME), dirs_exist_ok=True)
    return EpisodeStore(storage)


@pytest.fixture
def path(tmp_path: Path, driven: Path) -> Path:
    """A recording in several files, which may be changed."""
    [found] = shutil.copytree(driven, tmp_path / "one").glob("*.mcap")
    return found


def test_it_is_one_episode_equal_to_one_in_a_single_file(whole: Path, store: EpisodeStore) -> None:
    [episode_id] = store.ids()
    path = store.path(episode_id)
    assert len(part_paths(path)) >= 5
    assert told(open_episode(path)) == told(open_episode(whole))
    assert len(taught_frames(open_episode(path))) < 120, "lessons were undone"
    [summary], single = store.summaries(), read_summary(whole)
    assert (summary.frames, summary.taught) == (single.frames, single.taught)
    assert summary.duration_s == single.duration_s and summary.damage is None
    assert summary.bytes == sum(file.stat().st_size for file in part_paths(path).values())


def test_learning_it_again_gives_the_learner_that_was_driven(tmp_path: Path) -> None:
    robot = drive(tmp_path, SHORT)
    live = robot.loop.history.policy.get_state()
    episode = open_episode(robot.finish()[0])
    before = episode.model_before()
    assert before is not None
    policy = before.to_policy()
    learn_again(policy, [(episode, Notes())])
    assert same_nodes(policy.get_state(), live)


def test_every_file_is_read_by_the_library(store: EpisodeStore) -> None:
    from mcap.reader import make_reader

    frames = 0
    for file in part_paths(store.path(store.ids()[0])).values():
        with file.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True)
            frames += sum(1 for _ in reader.iter_messages(topics=["/camera"]))
    assert frames == store.summaries()[0].frames


def test_without_its_indexes_it_is_the_same(
    store: EpisodeStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = store.path(store.ids()[0])
    wanted = told(open_episode(path))
    monkeypatch.setattr("robot.recordings.episode.read_columns", lambda _: None)
    assert told(open_episode(path)) == wanted


def test_the_trash_takes_and_returns_all_files(store: EpisodeStore, tmp_path: Path) -> None:
    [episode_id] = store.ids()
    store.set_title(episode_id, "long")
    wanted = told(store.open(episode_id))
    key = store.delete(episode_id).key
    assert key is not None and list(tmp_path.glob(f"{NAME}/*[!.]*")) == []
    (tmp_path / NAME / f"{episode_id}.mcap").touch()  # the name is taken meanwhile
    [restored] = store.restore(key)
    assert restored != episode_id
    assert told(store.open(restored)) == wanted and store.notes(restored).title == "long"


def test_a_start_moves_no_file_of_a_recording(store: EpisodeStore, tmp_path: Path) -> None:
    [episode_id] = store.ids()
    store.set_title(episode_id, "long")
    wanted = told(store.open(episode_id))
    path = store.path(episode_id)
    (path.with_suffix(".parts") / "9.mcap").mkdir()
    path.with_name("other.parts").touch()
    names = ["9.mcap", "other.parts"]
    assert sorted(prepare(tmp_path)) == [(name, f"set-aside/{name}.1") for name in names]
    assert prepare(tmp_path) == [] and told(store.open(episode_id)) == wanted
    path.with_suffix(".parts").rename(tmp_path / ASIDE / f"{episode_id}.parts.1")  # an old version
    rejoin(Storage(tmp_path))
    assert told(store.open(episode_id)) == wanted


@pytest.fixture
def left(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The number of files that can still be moved before the program is killed; it may be set."""
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
    path: Path, tmp_path: Path, left: list[int], is_taken: bool
) -> None:
    """Killed before any move of a deletion or of a restoration, it is in the list or the trash."""
    wanted = list(open_episode(path).frames)
    for is_restored in (False, True):
        for kept in range(4):
            root = tmp_path / f"{is_restored}{kept}"
            storage = Storage(root)
            shutil.copytree(path.parent, root / NAME, dirs_exist_ok=True)
            store = EpisodeStore(storage)
            [episode_id] = store.ids()
            store.set_title(episode_id, "long")
            left[0] = MANY if is_restored else kept
            with contextlib.suppress(KeyboardInterrupt):
                key = store.delete(episode_id).key or ""
                left[0] = kept
                if is_taken:
                    shutil.copytree(path.parent, root / NAME, dirs_exist_ok=True)
                    shutil.rmtree(root / NAME / f"{episode_id}.parts")
                store.restore(key)
            left[0] = MANY
            rejoin(Storage(root))
            assert not list(strays(root / NAME))
            titled = [one.id for one in store.summaries() if one.title == "long"]
            [found] = titled or store.restore(max(store.trash()))
            assert list(store.open(found).frames) == wanted and store.notes(found).title == "long"
            assert store.trash() == []


def test_a_kill_while_it_is_made_compact_loses_nothing(
    path: Path, tmp_path: Path, left: list[int]
) -> None:
    wanted = list(open_episode(path).frames)
    for kept in range(6):  # mark, first file, notes, parts, new file, and the new file's notes
        root = tmp_path / str(kept)
        storage = Storage(root)
        shutil.copytree(path.parent, root / NAME, dirs_exist_ok=True)
        store = EpisodeStore(storage)
        [episode_id] = store.ids()
        store.set_title(episode_id, "long")
        store.edit(episode_id, Edit(verb="delete", ranges=((wanted[3], wanted[9]),)))
        left[0] = kept
        with pytest.raises(KeyboardInterrupt):
            store.compact(episode_id)
        left[0] = MANY
        rejoin(storage)
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


def test_joined_it_is_the_same_in_one_file(store: EpisodeStore, tmp_path: Path) -> None:
    path = store.path(store.ids()[0])
    joined = tmp_path / path.name
    with joined.open("wb") as file:
        join_recording(file.write, path)
    assert told(open_episode(joined)) == told(open_episode(path))
    assert read_summary(joined).taught == read_summary(path).taught


def test_a_zip_file_contains_all_files(store: EpisodeStore, tmp_path: Path) -> None:
    [episode_id] = store.ids()
    store.set_title(episode_id, "long")
    data = b"".join(zip_recordings([store.path(episode_id)]))
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        archive.extractall(tmp_path / "unpacked")
    path = tmp_path / "unpacked" / f"{episode_id}.mcap"
    assert told(open_episode(path)) == told(store.open(episode_id))
    assert notes_path(path).is_file()


def test_an_import_takes_all_files_as_one_drive(path: Path, tmp_path: Path) -> None:
    [source] = find_drives(path.parent)
    assert source.copy is not None
    target = tmp_path / path.name
    source.copy(target, ImportReport())
    assert told(open_episode(target)) == told(open_episode(path))


def test_a_drive_that_nobody_wants_leaves_no_file(tmp_path: Path) -> None:
    robot = RecordedBench(
        tmp_path, config=RecorderConfig(spare_bytes=0, part_s=1.0, keeps_drives=False)
    )
    robot.start(Mode.AUTONOMOUS)
    for scene in range(60):
        robot.step(scene, None)
    assert list(tmp_path.glob("*.parts"))
    robot.stop()
    assert robot.finish() == [] and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("left", [0, 4, 300, None])
def test_a_power_cut_in_a_part_costs_only_what_was_not_synced(path: Path, left: int | None) -> None:
    """The last part is missing, empty, or ends in its head or in its last chunk."""
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
    [other] = drive(tmp_path / "other", SHORT).finish()
    file, frames = part_paths(path)[gone], len(open_episode(path).frames)
    file.unlink()
    episode = open_episode(path)
    assert episode.damage == f"part {gone} is missing" == read_summary(path).damage
    assert 0 < len(episode.frames) < frames
    file.write_bytes(part_paths(other)[gone].read_bytes())
    assert "another recording" in str(open_episode(path).damage)
    assert list(open_episode(path).frames) == list(episode.frames)


@pytest.mark.parametrize("refused", range(3, 9))
def test_a_disk_that_refuses_a_part_ends_the_recording(tmp_path: Path, refused: int) -> None:
    files: list[BinaryIO] = []

    def open_file(path: Path) -> BinaryIO:
        if len(files) == refused:
            raise OSError(28, "No space left on device")
        files.append(path.open("xb"))
        return files[-1]

    robot = RecordedBench(tmp_path, config=SHORT, open_file=open_file)
    robot.start(Mode.TRAIN)
    for scene in range(200):
        robot.step(scene, None)
        if robot.recorder.queue.fault:
            break
    assert "No space left" in str(robot.recorder.queue.fault)
    [path] = sorted(tmp_path.glob("*.mcap"))
    assert open_episode(path).damage == CUT_SHORT and len(part_paths(path)) == refused
    robot.finish()
    assert all(file.closed for file in files)


def test_the_recorder_keeps_nothing_of_earlier_parts(tmp_path: Path) -> None:
    """Bytes kept at the beginning of each part; a page of marks covers 4096 frame ids."""
    clock = VirtualClock()
    config = RecorderConfig(spare_bytes=0, part_s=20.0)
    queue = RecordingQueue(tmp_path, config, lambda path: path.open("xb"), no_announcement, clock)
    queue.begin(describe_run(episode_id="long", run_id="r", origin_ns=10**18), None)
    taught, kept = FrameMarks(), []
    tracemalloc.start()
    try:
        for number in range(1, size("PICTURES", 3000, 9000)):
            clock.sleep(0.1)
            now_s, frame_id = clock.now_s(), 50 * number
            example = Example(frame_id=frame_id, label=Action.LEFT, is_intervention=False)
            event = Taught(example=example, x=np.zeros(0), at_s=now_s)
            taught.set_taught(frame_id, 1, now_s)
            queue.write_frame(jpeg_frame(frame_id, now_s, bytes(300)))
            queue.write_messages(now_s, lambda event=event: [(Topic.LESSON, describe_event(event))])
            if number % 20 == 0:
                queue.write_waiting()
                if number % 200 == 0:
                    gc.collect()
                    kept.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
        queue.end(None, is_kept=True)
        queue.write_waiting()
    assert len(part_paths(tmp_path / "long.mcap")) > 10
    third = len(kept) // 3
    growth = max(kept[2 * third :]) - max(kept[third : 2 * third])
    assert growth < 40_000, "five pages of marks: those of a part come and go"
