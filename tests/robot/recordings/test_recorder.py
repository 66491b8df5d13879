"""Runs are recorded while driven: everything that happened, without delaying the loop."""

from __future__ import annotations

import io
import json
import math
import random
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from mcap.reader import make_reader

from robot.clock import Clock
from robot.coaching.gallery import images
from robot.policy.events import Taught, to_json
from robot.recordings.episode import open_episode, taught_frames
from robot.recordings.messages import SCHEMAS, Topic, describe_sensors
from robot.store.disk import FLUSH_EVERY_S
from robot.testing import VirtualClock
from robot.types import Action, Game, Mode, Pose, Sensors
from tests.kit.protobuf import read_protobuf
from tests.kit.sizes import seeds
from tests.robot.store.models.lives import Disk

from .drives import RecordedBench


def test_everything_that_happened_is_in_the_recording(tmp_path: Path) -> None:
    robot = RecordedBench(tmp_path)
    robot.drive(range(40))
    episode = robot.episode()
    assert episode.damage is None
    assert episode.run["robot"] == "bench" and episode.run["learner"] == "published-8"
    assert json.loads(episode.run["options"]) == {"world": "bench"}
    assert len(episode.frames) >= 40
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


@pytest.mark.parametrize("seed", seeds(3, 10))
def test_a_power_cut_costs_only_what_was_not_flushed_yet(tmp_path: Path, seed: int) -> None:
    """At any moment the disk has a recording that ends at most a fifth of a second earlier."""
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
            assert lost_s <= FLUSH_EVERY_S + 2 * 0.1  # it flushes when a step ends


def test_recorded_pictures_are_read_as_the_camera_gave_them(tmp_path: Path) -> None:
    robot = RecordedBench(tmp_path)
    given = {}
    robot.start(Mode.TRAIN)
    for scene in range(20):
        robot.step(scene, Action.LEFT)
        frame = robot.camera.latest()
        assert frame is not None
        given[frame.frame_id] = frame
    episode = robot.episode()
    for frame_id, frame in given.items():
        back = episode.frame(frame_id)
        assert back.data == frame.data and back.encoding is frame.encoding
        assert (back.width, back.height) == (frame.width, frame.height)
        assert back.captured_s == pytest.approx(frame.captured_s, abs=2e-9)


def test_every_message_is_valid_against_its_schema(tmp_path: Path) -> None:
    """Read by the library itself, with the schemas in the file."""
    robot = RecordedBench(tmp_path)
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
            else:
                image = read_protobuf(schema.name, schema.data, message.data)
                assert schema.name == "foxglove.RawImage"
                assert (image.width, image.height, image.encoding) == (160, 120, "rgb8")
                assert len(image.data) == image.step * image.height
                assert image.timestamp.seconds * 10**9 + image.timestamp.nanos == message.log_time
    topics = {"/command", "/decision", "/prediction", "/sensors", "/mode", "/lesson"}
    assert seen == {"/camera", *topics}


@pytest.mark.parametrize("none", [math.inf, -math.inf, math.nan])
def test_a_reading_that_is_no_finite_number_counts_as_missing(none: float) -> None:
    """Drivers state infinity for an obstacle out of reach; JSON has no such number, and the mean
    of an exported dataset would be infinite, too."""
    sensors = Sensors(
        distance_m=none,
        bumped=np.bool_(True),  # type: ignore[arg-type]
        battery_share=none,
        pose=Pose(x_m=1.0, y_m=none, heading_rad=0.0),
        game=Game(number=1, score=none, reward=none, is_over=False),
    )
    told = describe_sensors(sensors)
    Draft202012Validator(SCHEMAS[Topic.SENSORS]).validate(json.loads(to_json(told)))
    json.dumps(told, allow_nan=False)
    assert (
        told.items() >= {"distance_m": None, "bumped": True, "battery": None, "pose": None}.items()
    )
    near = describe_sensors(Sensors(distance_m=0.25, pose=Pose(x_m=1, y_m=2, heading_rad=3)))
    assert (near["distance_m"], near["pose"]["y_m"]) == (0.25, 2)


def test_standing_for_a_while_ends_a_recording_and_the_next_drive_begins_another(
    tmp_path: Path,
) -> None:
    robot = RecordedBench(tmp_path)
    for scenes, stands_s in ((range(20), 5), (range(20, 40), 12), (range(40, 60), 0)):
        robot.drive(scenes)
        robot.stand(stands_s)
    assert [len(taught_frames(open_episode(path))) for path in robot.finish()] == [40, 20]


def test_a_standing_robot_fills_no_disk(tmp_path: Path) -> None:
    robot = RecordedBench(tmp_path)
    robot.drive(range(20))
    robot.stand(9)
    assert len(robot.episode().frames) <= 20 + 5


def test_pictures_from_before_the_start_go_along_when_they_are_labelled(tmp_path: Path) -> None:
    robot = RecordedBench(tmp_path)
    seen = robot.camera.show(1)
    robot.tick()
    robot.start(Mode.TRAIN, 2)
    robot.hold(Action.LEFT, frame_id=seen.frame_id)
    robot.tick()
    episode = robot.episode()
    assert seen.frame_id in taught_frames(episode)
    assert episode.frame(seen.frame_id).data == seen.data


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


def test_a_full_disk_stops_recording_with_a_message_and_the_robot_drives_on(tmp_path: Path) -> None:
    """A later drive is recorded again: see test_refusing_disk.py."""
    disk = Disk()
    robot = RecordedBench(tmp_path, open_file=disk.open)
    robot.start(Mode.TRAIN)
    robot.step(0, Action.LEFT)
    disk.is_full = True
    for scene in range(1, 20):
        robot.step(scene, Action.LEFT)
    fault = robot.recorder.recording.fault
    assert fault is not None and "No space left" in fault
    assert ("recording_off", {"detail": fault}) in robot.told
    assert robot.step(30, Action.RIGHT).sent is Action.RIGHT


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


@pytest.mark.parametrize(("does", "kept"), [("nothing", 0), ("teaches", 1), ("edits", 2)])
def test_runs_without_training_or_driving_are_not_kept(
    tmp_path: Path, does: str, kept: int
) -> None:
    robot = RecordedBench(tmp_path)
    robot.start(Mode.TRAIN, 0)
    for scene in range(5):
        robot.step(scene, None if does == "nothing" else Action.LEFT)
    robot.stop()
    if does == "edits":
        robot.recorder.finish()
        node = images(robot.loop.history.policy)[0].node_id
        robot.loop.submit(lambda: robot.loop.history.edit("pin", node, True))
        robot.tick()
    assert len(robot.finish()) == kept


@pytest.mark.parametrize(
    ("keeps_drives", "is_asked_for", "kept"),
    [(True, False, [40, 0]), (False, False, [40]), (False, True, [40, 0])],
)
def test_a_run_in_which_nothing_was_taught_is_dropped_unless_somebody_wants_it(
    tmp_path: Path, keeps_drives: bool, is_asked_for: bool, kept: list[int]
) -> None:
    robot = RecordedBench(tmp_path, keeps_drives=keeps_drives)
    robot.drive(range(40))
    robot.stand(12)
    robot.start(Mode.AUTONOMOUS, 40)
    for scene in range(40, 60):
        robot.step(scene, None)
    assert robot.loop.state.decision.action is not Action.STOP, "it drives itself"
    if is_asked_for:
        robot.recorder.keep()
    robot.stop()
    assert [len(taught_frames(open_episode(path))) for path in robot.finish()] == kept
