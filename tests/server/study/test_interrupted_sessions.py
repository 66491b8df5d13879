"""However a session is interrupted, the robot has its own model again, and the session can be
resumed."""

import shutil
from pathlib import Path

import pytest

from robot.devices.rig import Rig
from robot.policy.registry import make_policy
from robot.store.folder import Storage
from robot.testing import FakeCamera, FakeDriver, VirtualClock
from robot.types import Mode
from server.persistence import Persistence
from tests.server.test_teaching_routes import ask
from tests.server.virtual_server import VirtualServer

from .sessions import PLAN, answer, begin, drive, post, prepare, rows, session, standing

CHANGES_THE_MODEL = (
    ("POST", "/api/models", {}),
    ("POST", "/api/models/mine/load", {}),
    ("DELETE", "/api/models/mine", {}),
    ("POST", "/api/retraining/keep", {}),
    ("PUT", "/api/settings", {"max_nodes": 16, "name": "Mallory"}),
    ("PUT", "/api/settings", {"moves": ["forward", "right"], "speed": 0.5}),
)


class Loading(Persistence):
    """Loads the last model at its start, as `drivelesson serve` does before it serves."""

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
    """The next server finds what a killed server left on the disk."""
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
        log.write(b"1700000000.0,frame,1,sho")  # torn
    with started_again(tmp_path / "second") as server:
        assert session(server) is None
        current, names, arrays, moves = standing(server)
        assert (names, arrays, moves) == before[1:], "nothing is left of it among the models"
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
