"""Sessions of a study over HTTP, in virtual time: phases, questions, places, refusals."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

from robot.types import Mode
from server.study.extension import StudyExtension, describe_place, describe_session
from tests.server.study.sessions import (
    PLAN,
    TRUST,
    begin,
    drive,
    post,
    refused,
    session,
    standing,
)
from tests.server.test_teaching_routes import ask
from tests.server.virtual_server import VirtualServer


def test_a_condition_can_be_begun_anew(server: VirtualServer) -> None:
    begin(server)
    post(server, "/api/session/drive", confirmed=True)
    drive(server, 1.0)
    server.set_mode(Mode.STOPPED)
    post(server, "/api/session/drive", confirmed=True, anew=True)
    assert session(server)["phases"][0]["done_s"] == 0.0
    assert sum(server.rig.loop.state.taught.values()) == 0
    assert len([m for m in standing(server)[1] if "P01" in m]) == 1


def test_the_place_of_a_real_robot_is_confirmed_and_that_of_a_simulated_one_checked(
    server: VirtualServer,
) -> None:
    begin(server)
    said = refused(server, "/api/session/drive")
    assert "confirm that the robot stands in the place 'kitchen'" in said
    assert session(server)["needs_confirmation"]
    simulation = SimpleNamespace(world=SimpleNamespace(name="office"))
    server.driver.simulation = simulation  # type: ignore[attr-defined]
    before = standing(server)
    said = refused(server, "/api/session/drive", confirmed=True)
    assert "needs the world 'kitchen', but the robot is in 'office'; choose 'kitchen'" in said
    assert standing(server) == before
    assert session(server)["step"] == "ready"
    simulation.world.name = "kitchen"
    post(server, "/api/session/drive")
    assert session(server)["step"] == "drive"


def test_no_step_is_possible_out_of_turn_and_every_refusal_gives_the_reason(
    server: VirtualServer, tmp_path: Path
) -> None:
    assert "no session is running" in refused(server, "/api/session/drive")
    post(server, "/api/studies", name="walk", plan=PLAN)
    assert "there is already a study" in refused(server, "/api/studies", name="Walk", plan=PLAN)
    broken = PLAN.replace('kind = "alone"', 'kind = "alon"')
    assert "[[phase]] number 2" in refused(server, "/api/studies", name="w", plan=broken)
    for name in ("Mary", "P1 ", "../P01", "p01", "", "P12345"):
        said = refused(server, "/api/session", study="walk", participant=name)
        assert "is not a participant's code" in said and "never a name" in said
    assert (
        ask(server, "POST", "/api/session", json={"study": "x", "participant": "P01"}).status_code
        == 404
    )
    post(server, "/api/session", study="walk", participant="P01")
    assert "waits for 'consent'" in refused(server, "/api/session/drive", confirmed=True)
    assert "P01 is running" in refused(server, "/api/session", study="walk", participant="P02")
    assert "P01 is running" in refused(server, "/api/session", trial=1, teach_s=90)
    post(server, "/api/session/consent", language="en")
    assert "waits for 'ready'" in refused(server, "/api/session/answers", answers=TRUST)
    assert ask(server, "DELETE", "/api/studies/walk/sessions/P01").status_code == 409
    ask(server, "DELETE", "/api/session")
    plan = tmp_path / "studies/walk/plan.toml"
    plan.write_text(PLAN.replace("seconds = 2", "seconds = 4"))
    assert "the plan was changed" in refused(
        server, "/api/session", study="walk", participant="P01"
    )


def test_a_viewer_reads_the_state_of_a_session_but_neither_code_nor_answers(
    server: VirtualServer,
) -> None:
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


def test_a_trial_ends_with_the_results_of_pilot_and_robot(tmp_path: Path) -> None:
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
        again = post(server, "/api/session", trial=1, teach_s=90)["session"]
        assert again["participant"] == "T2", "each trial has a code of its own"
        ask(server, "DELETE", "/api/session")
    assert result["moves"] == ["forward", "left"] and result["recordings"]
    assert len(result["pilot"]["forward"]) == 201 and result["never_by_pilot"] == ["left"]
