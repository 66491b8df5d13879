"""A session's log on a disk that refuses: the written events stay."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from robot.study.events import StudyEvent, read_events, write_events
from robot.testing import VirtualClock
from server.study.event_log import EventLog


def test_an_incomplete_line_is_cut_off_when_the_disk_is_full(tmp_path: Path) -> None:
    resource = pytest.importorskip("resource")
    path = tmp_path / "P01.csv"
    whole = write_events([StudyEvent(wall_s=1.0, event="left")] * 3, with_head=True)
    path.write_text(whole + "2.0,le")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (16, limits[1]))
    try:
        log = EventLog(path, VirtualClock())
        log.start()
        log.stop()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert len(read_events(path.read_bytes())) == 3


def test_a_new_log_has_its_head_and_what_happens(tmp_path: Path) -> None:
    path = tmp_path / "studies" / "P01.csv"
    log = EventLog(path, VirtualClock())
    log.start()
    log.note([StudyEvent(wall_s=1.0, event="left")])
    log.stop()
    assert [event.event for event in read_events(path.read_bytes())] == ["left"]


def test_an_event_whose_write_failed_is_not_written_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.EIO, "Input/output error")

    path = tmp_path / "P01.csv"
    log = EventLog(path, VirtualClock())
    log.start()
    for n in range(3):
        log.note([StudyEvent(wall_s=float(n), event="left")])
        with monkeypatch.context() as patch:
            patch.setattr("os.fsync", refuse)
            patch.setattr("os.truncate", refuse)
            with pytest.raises(OSError, match="Input/output"):
                log.flush()
    log.flush()
    log.stop()
    assert [event.wall_s for event in read_events(path.read_bytes())] == [0.0, 1.0, 2.0]
