"""After a disk that refused for a moment, the next drive is recorded again, whenever it begins."""

from __future__ import annotations

import errno
import os
import random
from pathlib import Path
from typing import BinaryIO

import pytest

from robot.recordings.edits import Notes
from robot.recordings.episode import taught_frames
from robot.recordings.teaching import learn_again
from robot.store.models.model import same_nodes
from robot.types import Action, Mode
from tests.kit.sizes import crossed
from tests.robot.store.models.lives import Disk

from .drives import RecordedBench


@crossed(stood_s=[0.0, 0.5, 5.0, 9.5, 12.0], teaches_at_once=[False, True])
def test_the_drive_after_a_disk_error_is_recorded(
    tmp_path: Path, stood_s: float, teaches_at_once: bool
) -> None:
    chance, disk = random.Random(f"{stood_s}"), Disk()
    robot = RecordedBench(tmp_path, open_file=disk.open)
    queue, recording = robot.recorder.queue, robot.recorder.recording
    history = robot.loop.history
    robot.drive(range(chance.randrange(5, 20)))
    queue.write_waiting()
    disk.is_full = True
    robot.drive(range(20, 40))
    queue.write_waiting()
    assert recording.fault is not None and "No space left" in recording.fault
    disk.is_full = False
    robot.stand(stood_s)

    taught = history.taught.total()
    if teaches_at_once:  # in the same tick in which it starts
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


@pytest.mark.parametrize("refused", [0, 1, 2])
def test_every_file_is_closed_whichever_flush_the_disk_refuses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: int
) -> None:
    """At the beginning, in the middle and at the end of a recording."""
    files, flushed = [], 0

    def open_file(path: Path) -> BinaryIO:
        files.append(path.open("xb"))
        return files[-1]

    def fsync(_: int) -> None:
        nonlocal flushed
        flushed += 1
        if flushed > refused:
            raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(os, "fsync", fsync)
    robot = RecordedBench(tmp_path, open_file=open_file)
    robot.drive(range(10))
    robot.recorder.queue.write_waiting()
    robot.finish()
    assert robot.recorder.recording.fault is not None
    assert files and all(file.closed for file in files)
