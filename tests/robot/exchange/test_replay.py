"""A camera replays recorded footage."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from robot.errors import ConfigurationError, RecordingError
from robot.exchange.npz import load_recording
from robot.exchange.replay_camera import ReplayCamera, ReplayCameraOptions
from robot.recordings.edits import Edit, Notes, write_notes
from robot.testing import VirtualClock
from robot.types import Frame
from tests.robot.footage import write_footage
from tests.robot.recordings.drives import record_drive


def play(camera: ReplayCamera, count: int) -> list[Frame]:
    """Return the first `count` frames, or those that arrive before a fault."""
    frames: list[Frame] = []
    done = threading.Event()

    def note() -> None:
        frame = camera.latest()
        if camera.fault is None and frame is not None and len(frames) < count:
            frames.append(frame)
        if camera.fault is not None or len(frames) == count:
            done.set()

    camera.listen(note)
    with camera:
        assert camera.clock.wait(done, 10.0)
    return frames


def test_the_camera_plays_the_recorded_bytes_at_their_pace_and_begins_again(tmp_path: Path) -> None:
    path = write_footage(tmp_path / "hall_A.npz", n_frames=3, period_s=0.05)
    frames = play(ReplayCamera(ReplayCameraOptions(recording=str(path)), VirtualClock()), 7)
    files = [shot.picture().data for shot in load_recording(path).shots]
    assert [frame.data for frame in frames] == [files[i % 3] for i in range(7)]
    assert [frame.frame_id for frame in frames] == list(range(1, 8))
    assert frames[2].captured_s - frames[0].captured_s == pytest.approx(0.10)


def test_an_episode_plays_its_pictures_in_order_without_the_deleted_ones(tmp_path: Path) -> None:
    episode = record_drive(tmp_path, frames=20)
    ids = list(episode.frames)

    def played(count: int) -> list[bytes]:
        options = ReplayCameraOptions(episode=str(episode.path))
        return [frame.data for frame in play(ReplayCamera(options, VirtualClock()), count)]

    assert played(6) == [episode.frame(i).data for i in ids[:6]]
    write_notes(episode.path, Notes(edits=(Edit(verb="delete", ranges=((ids[0], ids[3]),)),)))
    assert played(3) == [episode.frame(i).data for i in ids[4:7]]


def test_the_camera_plays_a_folder_in_order_and_says_when_it_is_over(tmp_path: Path) -> None:
    first = write_footage(tmp_path / "a.npz", n_frames=2, seed=1, period_s=0.01)
    second = write_footage(tmp_path / "b.npz", n_frames=2, seed=2, period_s=0.01)
    options = ReplayCameraOptions(recording=str(tmp_path), loop=False)
    camera = ReplayCamera(options, VirtualClock())
    frames = play(camera, 99)
    shots = [*load_recording(first).shots, *load_recording(second).shots]
    files = [shot.picture().data for shot in shots]
    assert [frame.data for frame in frames] == files
    assert camera.fault is not None
    assert "has ended" in camera.fault


@pytest.mark.parametrize(
    "name", ["", "x.npz", "empty", "broken.npz", "missing.mcap", "broken.mcap"]
)
def test_a_recording_that_cannot_be_played_is_one_clear_error(tmp_path: Path, name: str) -> None:
    (tmp_path / "empty").mkdir()
    for broken in ("broken.npz", "broken.mcap"):
        (tmp_path / broken).write_bytes(b"no recording")
    option = "episode" if name.endswith(".mcap") else "recording"
    options = ReplayCameraOptions(**{option: str(tmp_path / name) if name else ""})
    with pytest.raises((ConfigurationError, RecordingError)) as caught:
        ReplayCamera(options, VirtualClock()).start()
    said = str(caught.value)
    assert name in said and "\n" not in said
    assert name or ("--recording" in said and "--episode" in said)
