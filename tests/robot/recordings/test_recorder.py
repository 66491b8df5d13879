"""The recorder records each event of a run, without delaying the loop."""

from __future__ import annotations

import errno
import io
import json
import math
import os
import random
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

import pytest
from jsonschema import Draft202012Validator
from mcap.reader import make_reader

from robot.clock import Clock
from robot.coaching.gallery import images
from robot.driver import Game, Pose, Sensors
from robot.exchange.tub import write_tub
from robot.policy.events import Taught
from robot.recordings.edits import Notes
from robot.recordings.episode import open_episode, taught_frames
from robot.recordings.messages import SCHEMAS, Topic, describe_sensors
from robot.recordings.parts import part_paths
from robot.recordings.reader import CUT_SHORT
from robot.recordings.teaching import learn_again
from robot.recordings.writer import EpisodeWriter, describe_run
from robot.store.disk import FLUSH_EVERY_S
from robot.store.models.model import same_nodes
from robot.testing import VirtualClock
from robot.types import Action, Encoding, Frame, Mode
from tests.kit.frames import make_frame
from tests.kit.protobuf import read_protobuf
from tests.kit.sizes import crossed, seeds
from tests.robot.store.models.lives import Disk

from .drives import MOVES, RecordedBench


def test_everything_that_happened_is_in_the_recording(tmp_path: Path) -> None:
    robot, given = RecordedBench(tmp_path), dict[int, Frame]()
    robot.start(Mode.TRAIN, 0)
    for scene in range(40):
        robot.step(scene, MOVES[scene // 4 % 3])
        frame = robot.camera.latest()
        assert frame is not None
        given[frame.frame_id] = frame
    robot.stop()
    episode = robot.episode()
    assert episode.damage is None
    assert episode.run["robot"] == "bench" and episode.run["learner"] == "published-8"
    assert episode.run["pictures"] == "rgb"
    assert json.loads(episode.run["options"]) == {"world": "bench"}
    for frame_id, frame in given.items():
        back = episode.frame(frame_id)
        assert back.captured_s == pytest.approx(frame.captured_s, abs=2e-9)
        assert replace(back, captured_s=frame.captured_s) == frame
    assert len(taught_frames(episode)) == robot.loop.history.taught.total() == 40
    held = [words["held"] for _, words in episode.messages(Topic.COMMAND)]
    assert held[:5] == ["forward"] * 4 + ["left"]
    assert {words["driven_by"] for _, words in episode.messages(Topic.DECISION)} >= {"pilot"}
    assert [words["mode"] for _, words in episode.messages(Topic.MODE)] == ["train", "stopped"]
    assert next(episode.messages(Topic.SENSORS))[1]["distance_m"] == 0.5
    assert list(episode.messages(Topic.PREDICTION))[-1][1]["confidence"] > 0
    models = [episode.model_before(), episode.model_after()]
    assert [model and model.summary.n_examples for model in models] == [0, 40]
    assert [name for name, _ in robot.told] == ["recording_on", "recording_done"]


def test_dates_are_those_of_the_drive_not_of_the_clocks_start(tmp_path: Path) -> None:
    """The machine was switched on days before the drive; only then was the loop's clock at 0."""
    robot = RecordedBench(tmp_path)
    robot.clock.advance(3 * 86_400.0)
    robot.clock.set_wall(1_700_000_000)
    robot.tick()
    robot.drive(range(20))
    episode = robot.episode()
    assert episode.origin_ns / 1e9 < 1_700_000_000 - 2 * 86_400
    write_tub(episode, Notes(), tmp_path / "tub")
    manifest = (tmp_path / "tub" / "manifest.json").read_text().splitlines()
    dates_s = [json.loads(manifest[3])["created_at"]]
    with episode.path.open("rb") as file:
        dates_s += [one.create_time / 1e9 for one in make_reader(file).iter_attachments()]
    assert dates_s == pytest.approx([1_700_000_000] * 4, abs=60), "the dates of models and index"


@pytest.mark.parametrize("seed", seeds(3, 10))
def test_a_power_cut_costs_only_what_was_not_flushed_yet(tmp_path: Path, seed: int) -> None:
    """At any moment, the recording on the disk lacks at most the last fifth of a second."""
    chance, robot = random.Random(seed), RecordedBench(tmp_path)
    start_s = robot.clock.now_s()
    robot.start(Mode.TRAIN)
    for scene in range(60):
        robot.step(scene, Action.LEFT, chance.uniform(0.01, 0.1))
        if chance.random() < 0.2:
            paths = (path for path in tmp_path.glob("*.mcap") if path.stat().st_size)
            kept = [open_episode(path) for path in paths]
            ends_s = [episode.start_s + episode.duration_s for episode in kept]
            lost_s = robot.clock.now_s() - max([start_s, *ends_s])
            assert lost_s <= FLUSH_EVERY_S + 2 * 0.1  # the disk's thread flushes after a step


def test_every_message_is_valid_against_its_schema(tmp_path: Path) -> None:
    """The library itself reads the file with its schemas. Foxglove draws the protobuf messages."""
    robot = RecordedBench(tmp_path)
    pose = Pose(x_m=1.0, y_m=2.0, heading_rad=3.0)
    robot.driver.sensors = Sensors(distance_m=0.5, bumped=False, pose=pose)
    robot.drive(range(30))
    node = images(robot.loop.history.policy)[0].node_id
    robot.loop.submit(lambda: robot.loop.history.edit("relabel", node, Action.LEFT))
    robot.undo(0.3)
    [path] = robot.finish()
    seen = set()
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert schema is not None
            seen.add(channel.topic)
            if schema.encoding == "jsonschema":
                described = json.loads(schema.data)
                Draft202012Validator.check_schema(described)
                Draft202012Validator(described).validate(json.loads(message.data))
                continue
            assert (schema.encoding, channel.message_encoding) == ("protobuf", "protobuf")
            drawn = read_protobuf(schema.name, schema.data, message.data)
            assert drawn.timestamp.ToNanoseconds() == message.log_time
            if channel.topic == "/pose":
                turn = drawn.pose.orientation
                assert (schema.name, drawn.frame_id) == ("foxglove.PoseInFrame", "floor")
                assert turn.z**2 + turn.w**2 == pytest.approx(1.0)
            else:
                image = drawn
                assert schema.name == "foxglove.RawImage"
                assert (image.width, image.height, image.encoding) == (160, 120, "rgb8")
                assert len(image.data) == image.step * image.height
    topics = {"/command", "/decision", "/prediction", "/sensors", "/mode", "/lesson", "/pose"}
    assert seen == {"/camera", *topics}


def test_the_score_of_a_game_that_is_not_finite_can_be_written() -> None:
    """JSON has no infinity. All other readings are finite (test_loop_stops.py)."""
    game = Game(number=1, score=math.inf, reward=math.nan, is_over=False)
    told = json.dumps(describe_sensors(Sensors(game=game)), allow_nan=False)
    Draft202012Validator(SCHEMAS[Topic.SENSORS]).validate(json.loads(told))


def test_standing_for_a_while_ends_a_recording_and_the_next_drive_begins_another(
    tmp_path: Path,
) -> None:
    """While the robot stands, few pictures are recorded."""
    robot = RecordedBench(tmp_path)
    for scenes, stands_s in ((range(20), 5), (range(20, 40), 12), (range(40, 60), 0)):
        robot.drive(scenes)
        robot.stand(stands_s)
    episodes = [open_episode(path) for path in robot.finish()]
    assert [len(taught_frames(episode)) for episode in episodes] == [40, 20]
    assert len(episodes[0].frames) <= 40 + 15


def test_large_pictures_from_before_the_start_leave_room_for_those_after_it(tmp_path: Path) -> None:
    robot = RecordedBench(tmp_path, queue_bytes=400_000)
    for _ in range(20):
        robot.camera.show(1)  # 57,600 bytes each
        robot.tick()
    robot.start(Mode.TRAIN, 2)
    robot.step(3, Action.LEFT)
    assert robot.recorder.queue.lost["frames"] == 0


class SlowFile(io.BytesIO):
    """A disk that sleeps: writing waits until the test releases it."""

    def __init__(self) -> None:
        super().__init__()
        self.clock: Clock = VirtualClock()
        self.awake = threading.Event()

    def write(self, data: Any) -> int:
        assert self.clock.wait(self.awake, 20)
        return super().write(data)

    def close(self) -> None:
        self.whole = self.getvalue()
        super().close()


def test_a_slow_disk_costs_pictures_but_neither_memory_nor_examples(tmp_path: Path) -> None:
    file = SlowFile()
    robot = RecordedBench(tmp_path, open_file=lambda path: file, queue_bytes=1_000_000)
    queue, file.clock = robot.recorder.queue, robot.clock
    robot.start(Mode.TRAIN)
    most = 0
    for scene in range(100):
        robot.step(scene, Action.LEFT)
        most = max(most, queue.waiting_bytes)
    assert most <= 1_000_000
    assert queue.lost["frames"] >= 80
    robot.recorder.finish()
    file.awake.set()
    robot.recorder.stop()
    (tmp_path / "slow.mcap").write_bytes(file.whole)
    episode = open_episode(tmp_path / "slow.mcap")
    assert len(episode.events) == 100
    assert all(
        isinstance(event, Taught) and (event.x.size or event.example.frame_id in episode.frames)
        for _, event in episode.events
    )
    assert ("recording_lossy", {"dropped_frames": queue.lost["frames"]}) in robot.told


def test_recording_keeps_room_on_the_disk_for_models(tmp_path: Path) -> None:
    robot = RecordedBench(tmp_path, spare_bytes=2**62)
    robot.drive(range(5))
    robot.recorder.finish()
    robot.recorder.stop()
    assert list(tmp_path.iterdir()) == []
    assert (
        robot.recorder.recording.fault is not None and "MB left" in robot.recorder.recording.fault
    )


def test_without_the_library_recording_is_off_with_a_message(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "mcap.writer", None)
    robot = RecordedBench(tmp_path)
    robot.drive(range(5))
    assert "drivelesson[episodes]" in str(robot.recorder.recording.fault)
    assert robot.finish() == []


@pytest.mark.parametrize("keeps_drives", [True, False])
@pytest.mark.parametrize(
    ("does", "is_kept"), [("drives", False), ("is asked for", True), ("edits", True)]
)
def test_a_run_in_which_nothing_was_taught_is_dropped_unless_somebody_wants_it(
    tmp_path: Path, keeps_drives: bool, does: str, is_kept: bool
) -> None:
    """A recording also contains an edit of a learned image."""
    robot = RecordedBench(tmp_path, keeps_drives=keeps_drives)
    robot.drive(range(40))
    robot.stand(12)
    robot.start(Mode.AUTONOMOUS, 40)
    for scene in range(40, 60):
        robot.step(scene, None)
    assert robot.loop.state.decision.action is not Action.STOP, "the robot drives by itself"
    if does == "is asked for":
        robot.recorder.keep()
    elif does == "edits":
        node = images(robot.loop.history.policy)[0].node_id
        robot.loop.submit(lambda: robot.loop.history.edit("pin", node, True))
        robot.tick()
    robot.stop()
    taught = [len(taught_frames(open_episode(path))) for path in robot.finish()]
    assert taught == ([40, 0] if keeps_drives or is_kept else [40])


def test_a_run_without_driving_or_teaching_is_not_kept(tmp_path: Path) -> None:
    robot = RecordedBench(tmp_path)
    robot.start(Mode.TRAIN)
    for scene in range(5):
        robot.step(scene, None)
    robot.stop()
    assert robot.finish() == []


@crossed(stood_s=[0.0, 0.5, 5.0, 9.5, 12.0], teaches_at_once=[False, True])
def test_a_full_disk_ends_the_recording_and_the_next_drive_is_recorded_again(
    tmp_path: Path, stood_s: float, teaches_at_once: bool
) -> None:
    """The robot drives on while a recording ends, whenever the next drive begins."""
    chance, disk = random.Random(f"{stood_s}"), Disk()
    robot = RecordedBench(tmp_path, open_file=disk.open)
    queue, recording = robot.recorder.queue, robot.recorder.recording
    history = robot.loop.history
    robot.drive(range(chance.randrange(5, 20)))
    queue.write_waiting()
    disk.is_full = True
    robot.start(Mode.TRAIN)
    assert [robot.step(20 + n, Action.LEFT).sent for n in range(20)] == [Action.LEFT] * 20
    robot.stop()
    queue.write_waiting()
    assert recording.fault is not None and "No space left" in recording.fault
    assert ("recording_off", {"detail": recording.fault}) in robot.told
    disk.is_full = False
    robot.stand(stood_s)

    taught = history.taught.total()
    if teaches_at_once:  # in the tick in which the robot starts
        frame = robot.camera.show(100)
        robot.loop.set_mode(Mode.TRAIN)
        robot.clock.sleep(0.05)
        robot.hold(Action.RIGHT, frame.frame_id)
        robot.tick()
    robot.drive(range(100, 140))
    live = history.policy.get_state()
    assert recording.fault is None and recording.episode_id is not None
    episode = robot.episode()
    before = episode.model_before()
    assert before is not None and episode.damage is None
    assert before.summary.n_examples - taught in (0, teaches_at_once)
    assert len(taught_frames(episode)) == history.taught.total() - before.summary.n_examples >= 40
    again = before.to_policy()
    learn_again(again, [(episode, Notes())])
    assert same_nodes(again.get_state(), live)


@crossed(refused=[0, 1, 2, 4, 8], what=["open", "flush"])
def test_every_file_is_closed_whatever_the_disk_refuses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str, refused: int
) -> None:
    """The disk is full at the beginning, in the middle or at the end of a recording or part."""
    files: list[BinaryIO] = []
    n_done = {"open": 0, "flush": 0}

    def count(kind: str) -> None:
        n_done[kind] += 1
        if kind == what and n_done[kind] > refused:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def open_file(path: Path) -> BinaryIO:
        count("open")
        files.append(path.open("xb"))
        return files[-1]

    monkeypatch.setattr(os, "fsync", lambda _: count("flush"))
    robot = RecordedBench(tmp_path, open_file=open_file, part_s=1.0)
    robot.drive(range(200))
    robot.recorder.queue.write_waiting()
    robot.recorder.finish()
    robot.recorder.stop()
    assert "No space left" in str(robot.recorder.recording.fault)
    assert all(file.closed for file in files)
    if what == "open" and refused:
        [path] = tmp_path.glob("*.mcap")
        assert open_episode(path).damage == CUT_SHORT and len(part_paths(path)) == refused


@pytest.mark.parametrize(("encoding", "compression"), [("jpeg", "lz4"), ("rgb", "zstd")])
def test_chunks_are_compressed_to_suit_the_pictures(
    tmp_path: Path, encoding: str, compression: str
) -> None:
    path, frame = tmp_path / "drive.mcap", make_frame(b"\xff\xd8" * 50, Encoding(encoding))
    run = describe_run(episode_id="drive", run_id="r", origin_ns=0, pictures=frame.encoding)
    writer = EpisodeWriter(path.open("xb"), run)
    writer.write_frame(frame)
    writer.close({"dropped_frames": "0", "lost_words": "0"})
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert {chunk.compression for chunk in summary.chunk_indexes} == {compression}
    episode = open_episode(path)
    assert episode.frame(frame.frame_id).data == frame.data
