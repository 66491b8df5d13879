"""However a session is interrupted, the robot keeps its model, and the log keeps its events."""

from __future__ import annotations

import contextlib
import errno
import shutil
from concurrent.futures import Future
from pathlib import Path

import pytest

from robot.devices.rig import Rig
from robot.errors import ConfigurationError
from robot.policy.registry import make_policy
from robot.store.folder import Storage
from robot.study.session import SessionStep
from robot.testing import FakeCamera, FakeDriver, VirtualClock
from robot.types import Mode
from server.persistence import Persistence
from server.study.conductor import Conductor
from server.study.event_log import EventLog
from tests.server.test_teaching_routes import ask
from tests.server.virtual_server import VirtualServer

from .sessions import PLAN, TRUST, answer, begin, drive, post, prepare, rows, session, standing

CHANGES_THE_MODEL = (
    ("POST", "/api/models", {}),
    ("POST", "/api/models/mine/load", {}),
    ("DELETE", "/api/models/mine", {}),
    ("POST", "/api/retraining/keep", {}),
    ("PUT", "/api/settings", {"max_nodes": 16, "name": "Mallory"}),
    ("PUT", "/api/settings", {"moves": ["forward", "right"], "speed": 0.5}),
)


class Loading(Persistence):
    """A server that loads the last model at its start, like `drivelesson serve`."""

    def start(self) -> None:
        super().start()
        self.autosave.load_last()


def started_again(data: Path) -> VirtualServer:
    clock = VirtualClock(100.0)
    rig = Rig(FakeDriver(clock=clock), FakeCamera(clock), make_policy("published-8"), clock)
    return VirtualServer(rig=rig, persistence=Loading(Storage(data), rig))


@pytest.mark.parametrize(
    ("at", "is_taught"),
    [("consent", True), ("ready", True), ("drive", True), ("drive", False), ("questions", True)],
)
def test_a_session_that_is_left_leaves_no_model_and_can_be_resumed(server, at, is_taught):
    before = prepare(server) if is_taught else standing(server)
    assert bool(before[1]) is is_taught
    if at == "consent":
        post(server, "/api/studies", name="walk", plan=PLAN)
        post(server, "/api/session", study="walk", participant="P01")
    else:
        begin(server)
    if at in ("drive", "questions"):
        post(server, "/api/session/drive", confirmed=True)
        drive(server, 1.0 if at == "drive" else None)
    if at == "questions":
        post(server, "/api/session/answers", answers={"trust_reliable": 2})
    server.set_mode(Mode.STOPPED)
    there = session(server)
    for method, path, body in CHANGES_THE_MODEL:
        refused = ask(server, method, path, json=body)
        assert refused.status_code == 409 and "session is running" in refused.text, path
    assert session(server) == there
    taught = dict(server.rig.loop.state.taught)
    ask(server, "DELETE", "/api/session")
    assert session(server) is None
    assert standing(server) == before
    begin(server)
    again = session(server)
    if at == "consent":
        assert again["step"] == "ready"
        return
    assert again == {**there, "is_driving": False}
    if at == "drive":
        assert there["phases"][0]["done_s"] == pytest.approx(1.0, abs=0.2)
        post(server, "/api/session/drive", confirmed=True)
        assert dict(server.rig.loop.state.taught) == taught
        drive(server)
        answer(server)
        assert [r["attempt"] for r in rows(server)] == ["1"] * 3


def test_after_a_power_cut_the_robot_has_its_own_model_and_the_session_goes_on(tmp_path):
    """The next server finds the files of a killed server."""
    with VirtualServer(data=tmp_path / "first") as server:
        before = prepare(server)
        begin(server)
        post(server, "/api/session/drive", confirmed=True)
        drive(server, 1.5)
        server.set_mode(Mode.STOPPED)
        server.forward(1.5)
        there, taught = session(server), sum(server.rig.loop.state.taught.values())
        shutil.copytree(tmp_path / "first", tmp_path / "second")
    (tmp_path / "second" / ".lock").unlink(missing_ok=True)
    with (tmp_path / "second/studies/walk/P01.csv").open("ab") as log:
        log.write(b"1700000000.0,frame,1,sho")  # a torn line
    with started_again(tmp_path / "second") as server:
        assert session(server) is None
        current, names, arrays, moves = standing(server)
        assert (names, arrays, moves) == before[1:], "the session leaves nothing among the models"
        assert current == before[0]
        listed = ask(server, "GET", "/api/studies/walk").json()["sessions"]
        assert [(s["participant"], s["step"]) for s in listed] == [("P01", "drive")]
        begin(server)
        post(server, "/api/session/drive", confirmed=True)
        again = session(server)
        assert again["phases"] == there["phases"]
        assert sum(server.rig.loop.state.taught.values()) == taught
        drive(server)
        answer(server)
        assert {(r["attempt"], r["is_complete"]) for r in rows(server)} == {("1", "1")}


@pytest.mark.parametrize(
    "text",
    [
        *("[" * 100_000, '{"study": "walk"}', "nan"),
        '{"study": "../..", "participant": "P01", "position": 1, "own": "x", "before": null, '
        '"learner_before": "x", "moves_before": ["left"]}',
    ],
)
def test_a_damaged_note_of_the_model_in_use_does_not_prevent_a_start(tmp_path, text):
    (tmp_path / "studies").mkdir(parents=True)
    (tmp_path / "studies/active.json").write_text(text)
    with VirtualServer(data=tmp_path) as server:
        begin(server)
        post(server, "/api/session/drive", confirmed=True)
        assert session(server)["is_driving"]


class Conducted:
    """A robot with the folder and conductor of its sessions; the session of P01 is running."""

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
    """In an earlier version, after a short suspension of the computer, the session went on, but its
    log did not."""
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
    """In an earlier version, a participant's answers were lost without a message."""

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
    """In an earlier version, two devices could skip a condition, and a start could count twice."""

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
