"""Sessions of a study over HTTP, in virtual time: phases, questions, slots and refusals.

tests/e2e/test_study.py runs a whole study, from the plan to its table.
"""

import itertools
import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

from robot.errors import ConfigurationError
from robot.simulator import world
from robot.simulator.driver import SimDriver, SimOptions
from robot.simulator.world import world_names
from robot.study.builtin import TRIALS, trial_plan
from robot.study.plan import Condition, parse_plan
from robot.testing import FakeDriver
from robot.types import Mode
from server.study.conductor import check_body
from server.study.extension import StudyExtension, describe_place, describe_session
from tests.server.test_teaching_routes import ask

from .sessions import PLAN, TRUST, begin, drive, post, refused, session, standing


def test_a_condition_can_be_begun_anew(server):
    begin(server)
    post(server, "/api/session/drive", confirmed=True)
    drive(server, 1.0)
    server.set_mode(Mode.STOPPED)
    post(server, "/api/session/drive", confirmed=True, anew=True)
    assert session(server)["phases"][0]["done_s"] == 0.0
    assert sum(server.rig.loop.state.taught.values()) == 0
    assert len([m for m in standing(server)[1] if "P01" in m]) == 1


def test_the_place_of_a_real_robot_is_confirmed_and_that_of_a_simulated_robot_checked(server):
    begin(server)
    said = refused(server, "/api/session/drive")
    assert "confirm that the robot is in the place 'kitchen'" in said
    assert session(server)["needs_confirmation"]
    simulation = SimpleNamespace(world=SimpleNamespace(name="office"))
    server.driver.simulation = simulation
    before = standing(server)
    said = refused(server, "/api/session/drive", confirmed=True)
    assert "needs the world 'kitchen', but the robot is in 'office'; choose 'kitchen'" in said
    assert standing(server) == before
    assert session(server)["step"] == "ready"
    simulation.world.name = "kitchen"
    post(server, "/api/session/drive")
    assert session(server)["step"] == "drive"


def test_no_step_is_possible_out_of_turn_and_every_refusal_gives_the_reason(server, tmp_path):
    assert "no session is running" in refused(server, "/api/session/drive")
    post(server, "/api/studies", name="walk", plan=PLAN)
    assert "there is already a study" in refused(server, "/api/studies", name="Walk", plan=PLAN)
    broken = PLAN.replace('kind = "alone"', 'kind = "alon"')
    assert "[[phase]] number 2" in refused(server, "/api/studies", name="w", plan=broken)
    for name in ("Mary", "P1 ", "../P01", "p01", "", "P12345"):
        said = refused(server, "/api/session", study="walk", participant=name)
        assert "is not a participant's code" in said and "never a name" in said
    nowhere = {"study": "x", "participant": "P01"}
    assert ask(server, "POST", "/api/session", json=nowhere).status_code == 404
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
    said = refused(server, "/api/session", study="walk", participant="P01")
    assert "the plan was changed" in said


def test_a_viewer_reads_the_state_of_a_session_but_neither_code_nor_answers(server):
    begin(server)
    post(server, "/api/session/drive", confirmed=True)
    drive(server)
    post(server, "/api/session/answers", answers={"trust_reliable": 2})
    conductor = server.services.extension(StudyExtension).conductor
    seen, whole = describe_place(conductor), describe_session(conductor)
    assert json.loads(json.dumps(whole)) == session(server)
    assert whole["answers"] == {"trust_reliable": "2"}
    names = ("step", "position", "of", "kind", "mode", "left_s")
    assert seen == dict(zip(names, ("questions", 1, 2, None, None, 0.0), strict=True))


def test_a_trial_ends_with_the_results_of_pilot_and_robot(server):
    conductor = server.services.extension(StudyExtension).conductor
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
    found = ask(server, "GET", "/api/studies/trial-1-90-published-8/sessions/T1").json()
    (result,) = found["conditions"]
    assert result["moves"] == ["forward", "left"] and result["recordings"]
    assert len(result["pilot"]["forward"]) == 201 and result["never_by_pilot"] == ["left"]
    ask(server, "DELETE", "/api/session")
    assert standing(server) == before
    again = post(server, "/api/session", trial=1, teach_s=90)["session"]
    assert again["participant"] == "T2", "each trial has a code of its own"


def condition(trial: int) -> Condition:
    return parse_plan(trial_plan(trial, 90)).conditions[0]


def test_a_trial_is_driven_only_in_its_world_and_anywhere_by_a_real_robot():
    for place, trial in itertools.product(world_names(), TRIALS):
        body, wanted = SimDriver(SimOptions(world=place)), TRIALS[trial][0]
        if place == wanted:
            check_body(body, condition(trial))
            continue
        with pytest.raises(
            ConfigurationError, match=f"but the robot is in {place!r}; choose {wanted!r} under"
        ):
            check_body(body, condition(trial))
    check_body(FakeDriver(), condition(1))


def test_a_world_that_is_only_a_file_is_known_by_its_file_and_by_its_name(tmp_path):
    file = tmp_path / "room.toml"
    shutil.copy(Path(world.__file__).parent / "worlds" / "box.toml", file)
    (tmp_path / "other").mkdir()
    here, elsewhere = SimDriver(SimOptions(world=str(file))), SimDriver(SimOptions())

    def driven_in(place):
        text = trial_plan(1, 90).replace('world = "box"', f"world = {json.dumps(place)}")
        return parse_plan(text).conditions[0]

    for place in ("room", str(file), str(tmp_path / "other" / ".." / "room.toml")):
        check_body(here, driven_in(place))
        with pytest.raises(ConfigurationError, match="--world and the world's TOML file"):
            check_body(elsewhere, driven_in(place))
    for place in ("roam", str(tmp_path / "other" / "room.toml")):
        with pytest.raises(ConfigurationError, match="this place is not offered under Settings"):
            check_body(here, driven_in(place))
    here.enter("office")
    here.advance(0.1)
    with pytest.raises(ConfigurationError, match="choose 'room' under Settings, Place"):
        check_body(here, driven_in(str(file)))
