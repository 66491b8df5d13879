"""What two pages ask of one session at the same moment happens one after the other."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from robot.devices.rig import Rig
from robot.errors import ConfigurationError
from robot.policy.registry import make_policy
from robot.store.folder import Storage
from robot.study.session import SessionStep
from robot.testing import FakeCamera, FakeDriver, VirtualClock
from server.persistence import Persistence
from server.study.conductor import Conductor
from tests.server.study.sessions import PLAN, TRUST


def test_what_is_asked_twice_at_once_is_done_once_and_every_page_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Answers that came from phone and tablet skipped a condition; a start counted twice."""
    clock = VirtualClock(100.0)
    rig = Rig(FakeDriver(clock=clock), FakeCamera(clock), make_policy("published-8"), clock)
    kept = Persistence(Storage(tmp_path), rig)
    told: list[object] = []
    submit = rig.loop.submit

    def take_long(work: Any) -> Any:
        clock.sleep(0.1)
        return submit(work)

    monkeypatch.setattr(rig.loop, "submit", take_long)

    def twice(act: Callable[[], object]) -> list[str]:
        refused: list[str] = []

        def once() -> None:
            try:
                act()
            except ConfigurationError as error:
                refused.append(str(error))

        for name in ("phone", "tablet"):
            clock.start_thread(once, name)
        clock.sleep(3.0)
        return refused

    with rig, kept, Conductor(rig, kept, lambda _, step: told.append(step)) as conductor:
        conductor.folder.create("walk", PLAN)
        assert twice(lambda: conductor.begin("walk", "P01")) == []
        assert len(twice(lambda: conductor.consent("en"))) == 1
        assert twice(lambda: conductor.drive(confirmed=True)) == []
        session = conductor.session
        assert session is not None
        for _ in range(2):
            session.make("phase_ended", 100.0)
        (said,) = twice(lambda: conductor.answer(TRUST, is_done=True))
        assert "waits for 'ready'" in said
        assert (session.position, session.step) == (1, SessionStep.READY)
        events = [event.event for event in conductor.folder.events("walk", "P01")]
    assert told[:4] == ["consent", "ready", "drive", "ready"]
    for once_only in ("session_begun", "consent", "condition_begun", "answered"):
        assert events.count(once_only) == 1, once_only
