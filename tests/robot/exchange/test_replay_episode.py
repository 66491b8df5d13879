"""A recorded run in place of a robot."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot.errors import ConfigurationError, RecordingError
from robot.exchange.replay_camera import ReplayCamera, ReplayCameraOptions
from robot.recordings.edits import Edit, Notes, write_notes
from robot.testing import VirtualClock
from tests.robot.recordings.drives import record_drive


def played(path: Path, at_least: int) -> list[bytes]:
    camera = ReplayCamera(ReplayCameraOptions(episode=str(path)), VirtualClock())
    seen: dict[int, bytes] = {}

    def note() -> None:
        frame = camera.latest()
        if frame is not None:
            seen[frame.frame_id] = frame.data

    camera.listen(note)
    with camera:
        while len(seen) < at_least and camera.clock.now_s() < 10.0:
            camera.clock.sleep(0.01)
    return list(seen.values())


def test_an_episode_plays_its_pictures_in_order_without_the_deleted_ones(tmp_path: Path) -> None:
    episode = record_drive(tmp_path, frames=20)
    ids = list(episode.frames)
    shown = played(episode.path, 6)
    assert shown[:6] == [episode.frame(i).data for i in ids[:6]]
    write_notes(episode.path, Notes(edits=(Edit(verb="delete", ranges=((ids[0], ids[3]),)),)))
    assert played(episode.path, 3)[:3] == [episode.frame(i).data for i in ids[4:7]]


def test_what_cannot_be_played_is_said(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="--episode"):
        ReplayCamera(ReplayCameraOptions(), VirtualClock())
    (tmp_path / "x.mcap").write_bytes(b"no episode")
    for name in ("x.mcap", "missing.mcap"):
        camera = ReplayCamera(ReplayCameraOptions(episode=str(tmp_path / name)), VirtualClock())
        with pytest.raises(RecordingError, match=name):
            camera.start()
