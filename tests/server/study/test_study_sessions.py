"""Sessions of a study over HTTP, in virtual time: phases, questions, leaving, a power cut."""

from __future__ import annotations

import csv
import io
import shutil
import zipfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from robot.devices.rig import Rig
from robot.policy.registry import make_policy
from robot.store.folder import Storage
from robot.testing import FakeCamera, FakeDriver, VirtualClock
from robot.types import Mode, Sensors
from server.persistence import Persistence
from tests.server.test_teaching_routes import _teach, ask
from tests.server.virtual_server import VirtualServer

PLAN = """
title = "Two times"
participants = 2
world = "kitchen"
moves = ["forward", "left"]
learner = "published-8"
consent = { en = "You may stop.", es = "Puede parar." }
questionnaires = ["trust"]
[[phase]]
kind = "teach"
seconds = 2
[[phase]]
kind = "alone"
seconds = 1
[[condition]]
name = "short"
[[condition]]
name = "long"
seconds = { teach = 3 }
"""
TRUST = {"trust_confident": 3, "trust_reliable": 4, "trust_can_trust": 5}


def post(server: VirtualServer, path: str, **body: Any) -> Any:
    answer = ask(server, "POST", path, json=body)
    assert answer.status_code in (200, 201), answer.text
    return answer.json()


def refused(server: VirtualServer, path: str, **body: Any) -> str:
    answer = ask(server, "POST", path, json=body)
    assert answer.status_code == 409, answer.text
    return str(answer.json()["detail"])


CHANGES_THE_MODEL = (
    ("POST", "/api/models"),
    ("POST", "/api/models/mine/load"),
    ("DELETE", "/api/models/mine"),
    ("POST", "/api/retraining/keep"),
    ("POST", "/api/lesson"),
)


def session(server: VirtualServer) -> Any:
    return ask(server, "GET", "/api/session").json()["session"]


def begin(server: VirtualServer, code: str = "P01") -> None:
    if "walk" not in ask(server, "GET", "/api/studies").json()["studies"]:
        post(server, "/api/studies", name="walk", plan=PLAN)
    post(server, "/api/session", study="walk", participant=code)
    if session(server)["step"] == "consent":
        post(server, "/api/session/consent", language="es")


def drive(server: VirtualServer, seconds: float | None = None) -> None:
    """Drive in the mode of the phase, for some seconds or until the questions."""
    server.driver.sensors = Sensors(distance_m=0.8)
    pilot = server.pilot()
    now = ask(server, "GET", "/api/lesson").json()["lesson"]
    while now["mode"] is not None:
        pilot.mode(now["mode"])
        pilot.hold("forward" if now["mode"] == "train" else None)
        pilot.wait_for_state(mode=now["mode"])
        if seconds is not None:
            server.forward(seconds)
            break
        for _ in range(40):
            server.forward(0.25)
            if server.rig.loop.mode is Mode.STOPPED:
                break
        now = ask(server, "GET", "/api/lesson").json()["lesson"]
    pilot.close()


def answer(server: VirtualServer) -> None:
    post(server, "/api/session/answers", answers=TRUST, done=True)


def take_part(server: VirtualServer, code: str) -> None:
    begin(server, code)
    while session(server)["step"] != "done":
        post(server, "/api/session/drive", confirmed=True)
        drive(server)
        answer(server)
    ask(server, "DELETE", "/api/session")


def rows(server: VirtualServer) -> list[dict[str, str]]:
    data = ask(server, "GET", "/api/studies/walk/zip").content
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return list(csv.DictReader(io.StringIO(archive.read("phases.csv").decode())))


def standing(server: VirtualServer) -> tuple[Any, ...]:
    """The robot's models, which of them is in use, and what it knows to the last bit."""
    models = ask(server, "GET", "/api/models").json()
    state = server.ask_loop(lambda: server.rig.loop.history.policy.get_state())
    arrays = {name: array.tobytes() for name, array in state.arrays.items()}
    moves = server.rig.loop.history.policy.moves
    return models["current"], sorted(m["name"] for m in models["models"]), arrays, moves


def prepare(server: VirtualServer) -> tuple[Any, ...]:
    """Teach the robot something that is its own."""
    _teach(server, 40)
    ask(server, "POST", "/api/models/save", json={})
    return standing(server)


class Loading(Persistence):
    """Loads the last model when it starts, as `drivelesson serve` does before it serves."""

    def start(self) -> None:
        super().start()
        self.autosave.load_last()


def started_again(data: Path) -> VirtualServer:
    clock = VirtualClock(100.0)
    rig = Rig(FakeDriver(clock=clock), FakeCamera(clock), make_policy("published-8"), clock)
    return VirtualServer(rig=rig, persistence=Loading(Storage(data), rig))


def test_two_participants_meet_both_conditions_in_balanced_order(tmp_path: Path) -> None:
    with VirtualServer(data=tmp_path) as server:
        before = prepare(server)
        take_part(server, "P01")
        take_part(server, "P02")
        assert standing(server) == before
        found = rows(server)
        study = ask(server, "GET", "/api/studies/walk").json()
    assert [(r["participant"], r["position"], r["condition"], r["phase"]) for r in found] == [
        (code, str(position), condition, phase)
        for code, order in (("P01", ("short", "long")), ("P02", ("long", "short")))
        for position, condition in enumerate(order, start=1)
        for phase in ("teach", "alone", "questions")
    ]
    assert {r["is_complete"] for r in found} == {"1"}
    assert {r["place_checked_by"] for r in found} == {"researcher"}
    taught = [int(r["examples"]) for r in found if r["phase"] == "teach"]
    assert min(taught) > 30, "every condition begins with an empty model and is taught"
    for row in found:
        if row["kind"] in ("teach", "alone"):
            assert float(row["driven_s"]) == float(row["planned_s"])
            assert row["recordings"], "each phase names what was recorded of it"
    assert {r["trust"] for r in found if r["trust"]} == {"4.0"}
    assert (study["done"], study["next_order"]) == (2, None)


def test_a_robot_that_knew_nothing_has_no_model_afterwards(tmp_path: Path) -> None:
    with VirtualServer(data=tmp_path) as server:
        before = standing(server)
        for _ in range(2):
            begin(server)
            post(server, "/api/session/drive", confirmed=True)
            drive(server, 0.5)
            ask(server, "DELETE", "/api/session")
            assert standing(server) == before
        assert before[1] == []


@pytest.mark.parametrize("at", ["consent", "ready", "drive", "questions"])
def test_a_session_that_is_left_leaves_no_model_and_goes_on_where_it_was(
    tmp_path: Path, at: str
) -> None:
    with VirtualServer(data=tmp_path) as server:
        before = prepare(server)
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
        for method, path in CHANGES_THE_MODEL:
            refused = ask(server, method, path, json={"trial": 1, "teach_s": 90})
            assert refused.status_code == 409 and "session is on" in refused.text, path
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


def test_after_a_power_cut_the_robot_has_its_own_model_and_the_session_goes_on(
    tmp_path: Path,
) -> None:
    """What a killed server leaves on the disk is found by the next one."""
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


def test_a_condition_can_be_begun_anew(tmp_path: Path) -> None:
    with VirtualServer(data=tmp_path) as server:
        begin(server)
        post(server, "/api/session/drive", confirmed=True)
        drive(server, 1.0)
        server.set_mode(Mode.STOPPED)
        post(server, "/api/session/drive", confirmed=True, anew=True)
        assert session(server)["phases"][0]["done_s"] == 0.0
        assert sum(server.rig.loop.state.taught.values()) == 0
        assert len([m for m in standing(server)[1] if "P01" in m]) == 1


def test_the_place_of_a_real_robot_is_confirmed_and_that_of_a_simulated_one_checked(
    tmp_path: Path,
) -> None:
    with VirtualServer(data=tmp_path) as server:
        begin(server)
        said = refused(server, "/api/session/drive")
        assert "confirm that the robot stands in the place 'kitchen'" in said
        assert session(server)["needs_confirmation"]
        simulation = SimpleNamespace(world=SimpleNamespace(name="office"))
        server.driver.simulation = simulation  # type: ignore[attr-defined]
        before = standing(server)
        said = refused(server, "/api/session/drive", confirmed=True)
        assert "the world 'kitchen', and this is 'office'; start the simulator with --world" in said
        assert standing(server) == before
        assert session(server)["step"] == "ready"
        simulation.world.name = "kitchen"
        post(server, "/api/session/drive")
        assert session(server)["step"] == "drive"


def test_nothing_comes_out_of_its_turn_and_every_refusal_says_why(tmp_path: Path) -> None:
    with VirtualServer(data=tmp_path) as server:
        assert "no session is on" in refused(server, "/api/session/drive")
        post(server, "/api/studies", name="walk", plan=PLAN)
        assert "there is already a study" in refused(server, "/api/studies", name="Walk", plan=PLAN)
        broken = PLAN.replace('kind = "alone"', 'kind = "alon"')
        assert "[[phase]] number 2" in refused(server, "/api/studies", name="w", plan=broken)
        for name in ("Mary", "P1 ", "../P01", "p01", "", "P12345"):
            said = refused(server, "/api/session", study="walk", participant=name)
            assert "is no code" in said and "never a name" in said
        assert (
            ask(
                server, "POST", "/api/session", json={"study": "x", "participant": "P01"}
            ).status_code
            == 404
        )
        post(server, "/api/session", study="walk", participant="P01")
        assert "waits for 'consent'" in refused(server, "/api/session/drive", confirmed=True)
        assert "P01 is on" in refused(server, "/api/session", study="walk", participant="P02")
        assert "session is on" in refused(server, "/api/lesson", trial=1, teach_s=90)
        post(server, "/api/session/consent", language="en")
        assert "waits for 'ready'" in refused(server, "/api/session/answers", answers=TRUST)
        assert ask(server, "DELETE", "/api/studies/walk/sessions/P01").status_code == 409
        ask(server, "DELETE", "/api/session")
        plan = tmp_path / "studies/walk/plan.toml"
        plan.write_text(PLAN.replace("seconds = 2", "seconds = 4"))
        assert "the plan was changed" in refused(
            server, "/api/session", study="walk", participant="P01"
        )


def test_answers_are_checked_and_all_are_needed(tmp_path: Path) -> None:
    with VirtualServer(data=tmp_path) as server:
        begin(server)
        post(server, "/api/session/drive", confirmed=True)
        drive(server)
        path = "/api/session/answers"
        assert "'trust_reliable' must be" in refused(server, path, answers={"trust_reliable": 9})
        assert "no question 'mood'" in refused(server, path, answers={"mood": 3})
        post(server, path, answers={"trust_reliable": 4})
        said = refused(server, path, done=True)
        assert "trust_confident, trust_can_trust" in said and "trust_reliable" not in said
        post(server, path, answers=TRUST)
        assert session(server)["answers"] == {name: str(n) for name, n in TRUST.items()}
        post(server, path, done=True)
        assert (session(server)["step"], session(server)["position"]) == ("ready", 2)


def test_a_withdrawn_participant_leaves_nothing_and_frees_the_place(tmp_path: Path) -> None:
    with VirtualServer(data=tmp_path) as server:
        take_part(server, "P01")
        begin(server, "P02")
        ask(server, "DELETE", "/api/session")
        assert "all 2 places" in refused(server, "/api/session", study="walk", participant="P03")
        kept = list((tmp_path / "studies/walk").rglob("P01*"))
        assert len(kept) == 3, "a log and two models"
        assert ask(server, "DELETE", "/api/studies/walk/sessions/P01").status_code == 200
        assert not list((tmp_path / "studies/walk").rglob("P01*"))
        begin(server, "P03")
        assert session(server)["of"] == 2
        listed = ask(server, "GET", "/api/studies/walk").json()["sessions"]
        assert {s["participant"]: s["order"][0] for s in listed} == {"P02": "long", "P03": "short"}


def test_a_damaged_log_is_named_and_stops_nobody_else(tmp_path: Path) -> None:
    with VirtualServer(data=tmp_path) as server:
        begin(server, "P01")
        ask(server, "DELETE", "/api/session")
        (tmp_path / "studies/walk/P02.csv").write_bytes(b"\xff\xfe\n\n")
        listed = ask(server, "GET", "/api/studies/walk").json()["sessions"]
        assert [bool(s["fault"]) for s in listed] == [False, True]
        answer = ask(server, "POST", "/api/session", json={"study": "walk", "participant": "P02"})
        assert answer.status_code == 422 and "P02.csv" in answer.json()["detail"]
        begin(server, "P01")
