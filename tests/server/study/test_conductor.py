"""If two pages change one session at the same moment, the changes happen one after the other."""

from __future__ import annotations

import contextlib
import errno
from concurrent.futures import Future
from pathlib import Path

import pytest

from robot.devices.rig import Rig
from robot.errors import ConfigurationError
from robot.policy.registry import make_policy
from robot.store.folder import Storage
from robot.study.session import SessionStep
from robot.testing import FakeCamera, FakeDriver, VirtualClock
from server.persistence import Persistence
from server.study.conductor import Conductor
from server.study.event_log import EventLog
from tests.server.study.sessions import PLAN, TRUST


class Conducted:
    """A robot, the folder of its sessions, and their conductor; a session of P01 is running."""

    def __init__(self, folder: Path) -> None:
        self.clock = VirtualClock(100.0)
        camera, driver = FakeCamera(self.clock), FakeDriver(clock=self.clock)
        self.rig = Rig(driver, camera, make_policy("published-8"), self.clock)
        self.kept = Persistence(Storage(folder), self.rig)
        self.told: list[object] = []
        self.conductor = Conductor(self.rig, self.kept, lambda _, step: self.told.append(step))

    def __enter__(self) -> Conducted:
        self._stack = contextlib.ExitStack()
        for part in (self.rig, self.kept, self.conductor):
            self._stack.enter_context(part)
        self.conductor.folder.create("walk", PLAN)
        self.conductor.begin("walk", "P01")
        return self

    def __exit__(self, *exc: object) -> None:
        self._stack.close()

    @property
    def events(self) -> list[str]:
        return [event.event for event in self.conductor.folder.events("walk", "P01")]


def test_an_event_that_happens_after_its_timeout_is_in_the_log_too(tmp_path, monkeypatch):
    """Before, after a short suspension of the computer only the session went on, not its log."""
    with Conducted(tmp_path) as world:
        submit = world.rig.loop.submit

        def much_later(work):
            world.clock.start_thread(lambda: (world.clock.sleep(12.0), submit(work)), "late")
            return Future()

        with monkeypatch.context() as patch:
            patch.setattr(world.rig.loop, "submit", much_later)
            with pytest.raises(TimeoutError):
                world.conductor.consent("en")
        world.clock.sleep(5.0)
        assert world.conductor.session.step is SessionStep.READY
        assert world.events == ["session_begun", "consent"]


def test_a_session_cannot_be_left_while_its_events_cannot_be_written(tmp_path, monkeypatch):
    """Before, a participant's answers were lost without a message."""

    def refuse(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with Conducted(tmp_path) as world:
        with monkeypatch.context() as patch:
            patch.setattr(EventLog, "flush", refuse)
            for act in (lambda: world.conductor.consent("en"), world.conductor.leave):
                with pytest.raises(OSError, match="No space left"):
                    act()
            assert world.conductor.session is not None
        world.conductor.leave()
        assert world.conductor.session is None
        assert world.events == ["session_begun", "consent", "left"]


def test_a_request_sent_twice_at_once_is_done_once_and_every_page_learns_of_it(
    tmp_path, monkeypatch
):
    """Before, answers from two devices skipped a condition, and one start counted twice."""

    def twice(act):
        refused: list[str] = []

        def once():
            try:
                act()
            except ConfigurationError as error:
                refused.append(str(error))

        for name in ("phone", "tablet"):
            clock.start_thread(once, name)
        clock.sleep(3.0)
        return refused

    with Conducted(tmp_path) as world:
        clock, conductor, session = world.clock, world.conductor, world.conductor.session
        submit = world.rig.loop.submit

        def take_long(work):
            clock.sleep(0.1)
            return submit(work)

        monkeypatch.setattr(world.rig.loop, "submit", take_long)
        assert twice(lambda: conductor.begin("walk", "P01")) == []
        assert len(twice(lambda: conductor.consent("en"))) == 1
        assert twice(lambda: conductor.drive(confirmed=True)) == []
        for _ in range(2):
            session.make("phase_ended", 100.0)
        (said,) = twice(lambda: conductor.answer(TRUST, is_done=True))
        assert "waits for 'ready'" in said
        assert (session.position, session.step) == (1, SessionStep.READY)
        assert world.told[:4] == ["consent", "ready", "drive", "ready"]
        for once_only in ("session_begun", "consent", "condition_begun", "answered"):
            assert world.events.count(once_only) == 1, once_only
