"""Sessions of a study over HTTP, in virtual time: phases, questions, leaving, a power cut."""

from __future__ import annotations

import csv
import io
import json
import shutil
import zipfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from robot.devices.rig import Rig
from robot.errors import ConfigurationError
from robot.policy.registry import make_policy
from robot.store.folder import Storage
from robot.testing import FakeCamera, FakeDriver, VirtualClock
from robot.types import Mode, Sensors
from server.persistence import Persistence
from server.study.extension import StudyExtension, describe_place, describe_session
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
    now = session(server)
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
        now = session(server)
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
            refused = ask(server, method, path, json={})
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
        assert "P01 is on" in refused(server, "/api/session", trial=1, teach_s=90)
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


def files_with(folder: Path, words: set[bytes]) -> list[str]:
    """What is called like one of these words, or holds one."""
    found = (path for path in folder.rglob("*") if path.is_file())
    return [
        str(path.relative_to(folder))
        for path in found
        if any(word in str(path).encode() or word in path.read_bytes() for word in words)
    ]


def test_a_withdrawn_participant_leaves_nothing_and_frees_the_place(tmp_path: Path) -> None:
    with VirtualServer(data=tmp_path) as server:
        pilot = server.pilot()
        pilot.mode("train")
        pilot.hold("forward")
        server.forward(2.0)
        pilot.close()
        server.forward(12.0)
        own = {e["id"] for e in ask(server, "GET", "/api/episodes").json()["episodes"]}
        take_part(server, "P01")
        server.forward(11.0)
        begin(server, "P02")
        ask(server, "DELETE", "/api/session")
        assert "all 2 places" in refused(server, "/api/session", study="walk", participant="P03")
        kept = list((tmp_path / "studies/walk").rglob("P01*"))
        assert len(kept) == 3, "a log and two models"
        driven = {id for row in rows(server) for id in row["recordings"].split()}
        assert len(driven) >= 2 and own and not own & driven
        gone = ask(server, "DELETE", f"/api/episodes/{min(driven)}")
        assert gone.status_code == 200, "one of the recordings is in the trash by now"
        answer = ask(server, "DELETE", "/api/studies/walk/sessions/P01")
        assert answer.status_code == 200, answer.text
        deleted = answer.json()["deleted"]
        recordings = {Path(path).stem for path in deleted if path.endswith(".mcap")}
        assert recordings == driven
        assert any(path.startswith("trash/") and path.endswith(".mcap") for path in deleted)
        assert {"studies/walk/P01.csv", "studies/walk/models/P01-1.npz"} < set(deleted)
        assert not [path for path in deleted if (tmp_path / path).exists()]
        assert not list(tmp_path.rglob("*P01*"))
        assert files_with(tmp_path / "episodes", {id.encode() for id in driven}) == []
        left = {e["id"] for e in ask(server, "GET", "/api/episodes").json()["episodes"]}
        assert own <= left and not driven & left
        begin(server, "P03")
        assert session(server)["of"] == 2
        listed = ask(server, "GET", "/api/studies/walk").json()["sessions"]
        assert {s["participant"]: s["order"][0] for s in listed} == {"P02": "long", "P03": "short"}


def test_a_session_that_is_still_recorded_is_not_withdrawn(tmp_path: Path) -> None:
    with VirtualServer(data=tmp_path) as server:
        begin(server)
        post(server, "/api/session/drive", confirmed=True)
        drive(server, 1.0)
        ask(server, "DELETE", "/api/session")
        conductor = server.services.extension(StudyExtension).conductor
        assert conductor is not None
        (recording,) = {
            e.value for e in conductor.folder.events("walk", "P01") if e.event == "recording"
        }
        with pytest.raises(ConfigurationError, match="still being recorded"):
            conductor.folder.withdraw("walk", "P01", recording)
        assert (tmp_path / "studies/walk/P01.csv").exists()


def test_a_viewer_reads_where_a_session_stands_and_neither_code_nor_answers(tmp_path: Path) -> None:
    with VirtualServer(data=tmp_path) as server:
        begin(server)
        post(server, "/api/session/drive", confirmed=True)
        drive(server)
        post(server, "/api/session/answers", answers={"trust_reliable": 2})
        conductor = server.services.extension(StudyExtension).conductor
        assert conductor is not None
        seen, whole = describe_place(conductor), describe_session(conductor)
        assert json.loads(json.dumps(whole)) == session(server) and whole["answers"] == {
            "trust_reliable": "2"
        }
        names = ("step", "position", "of", "kind", "mode", "left_s")
        assert seen == dict(zip(names, ("questions", 1, 2, None, None, 0.0), strict=True))


def test_a_trial_ends_with_what_pilot_and_robot_did(tmp_path: Path) -> None:
    with VirtualServer(data=tmp_path) as server:
        conductor = server.services.extension(StudyExtension).conductor
        assert conductor is not None
        conductor.pace = 30.0
        before = standing(server)
        post(server, "/api/session", trial=1, teach_s=90)
        post(server, "/api/session/drive", confirmed=True)
        assert set(server.rig.loop.state.moves) == {"forward", "left"}
        drive(server)
        (question,) = session(server)["questions"]
        post(server, "/api/session/answers", answers={question["name"]: 6}, done=True)
        ended = session(server)
        assert (ended["step"], ended["shows_result"]) == ("done", True)
        (result,) = ask(server, "GET", "/api/studies/trial-1-90-published-8/sessions/T1").json()[
            "conditions"
        ]
        ask(server, "DELETE", "/api/session")
        assert standing(server) == before
    assert result["moves"] == ["forward", "left"] and result["recordings"]
    assert len(result["pilot"]["forward"]) == 201 and result["never_by_pilot"] == ["left"]


def test_results_of_older_trials_are_listed_and_downloaded_whatever_else_is_there(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "lessons"
    folder.mkdir(parents=True)
    names = ["20260101-140000-trial-2", "20260101-120000-trial-1"]
    texts = {names[0]: '{"trial": 2, "ssd": null}', names[1]: "damaged", "list": "[1]"}
    for name, text in texts.items():
        (folder / f"{name}.json").write_text(text)
    (folder / "20260101-130000-trial-1.json").mkdir()
    with VirtualServer(data=tmp_path) as server:
        listed = ask(server, "GET", "/api/studies")
        assert listed.status_code == 200, listed.text
        assert listed.json()["older"] == names
        for name in names:
            answer = ask(server, "GET", f"/api/studies/older/{name}.json")
            assert answer.content == texts[name].encode()
        for name in ("20260101-130000-trial-1", "..%2F..%2Fx", "list"):
            assert ask(server, "GET", f"/api/studies/older/{name}.json").status_code == 404


@pytest.mark.parametrize(
    "text",
    [
        *("[]", "[" * 100_000, '{"study": "walk"}', "nan", '{"study": 1, "moves_before": 2}'),
        '{"study": "../..", "participant": "P01", "position": 1, "own": "x", "before": null, '
        '"learner_before": "x", "moves_before": ["left"]}',
    ],
)
def test_a_damaged_note_of_the_model_in_use_keeps_no_robot_from_starting(
    tmp_path: Path, text: str
) -> None:
    (tmp_path / "studies").mkdir(parents=True)
    (tmp_path / "studies/active.json").write_text(text)
    with VirtualServer(data=tmp_path) as server:
        begin(server)
        post(server, "/api/session/drive", confirmed=True)
        assert session(server)["is_driving"]


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
