"""The paper's trial of one person, a built-in study: its phases, its clock, and its result."""

import json
from typing import Any

import pytest

from robot.errors import ConfigurationError
from robot.study.builtin import TRIALS, trial_plan
from robot.study.plan import MOST_PARTICIPANTS, parse_plan
from robot.study.rows import condition_logs, outcome
from robot.study.session import SessionStep
from robot.types import Action, DrivenBy, Mode

from .scripted import How, Participant


def begun(pace: float = 1.0) -> Participant:
    person = Participant(parse_plan(trial_plan(1, 90)), pace=pace)
    person.begin()
    return person


def pilot(action: Action, distance_m: float | None, mode: Mode = Mode.TRAIN) -> How:
    return mode, DrivenBy.PILOT, action, distance_m


def robot(action: Action, distance_m: float | None) -> How:
    return Mode.AUTONOMOUS, DrivenBy.ROBOT, action, distance_m


def phase(person: Participant) -> str | None:
    return person.session.phase.kind if person.session.phase else None


def outcome_of(*drives: tuple[float, How]) -> dict[str, Any]:
    """Return the result of a trial with these drives, each with its seconds."""
    person = begun()
    for seconds, how in drives:
        person.drive(seconds, how=how)
    [log] = condition_logs(person.session.plan, "P01", person.log)
    return outcome(log)


def turning(robot_turns_at_m: float) -> dict[str, Any]:
    """Return the result of a robot that was taught to turn at 0.2 m."""
    return outcome_of(
        (60, pilot(Action.FORWARD, 1.0)),
        (31, pilot(Action.LEFT, 0.2)),
        (300, robot(Action.FORWARD, 1.0)),
        (29, pilot(Action.LEFT, 0.3, Mode.AUTONOMOUS)),
        (41, robot(Action.FORWARD, 1.0)),
        (21, robot(Action.LEFT, robot_turns_at_m)),
    )


def test_the_phases_follow_each_other_and_end_each():
    person = begun()
    for kind, seconds, by in (("teach", 90, pilot), ("correct", 330, robot), ("alone", 60, robot)):
        assert phase(person) == kind
        assert person.session.left_s == pytest.approx(seconds, abs=1.0)
        person.drive(seconds - 2, how=by(Action.FORWARD, 1.0))
        assert phase(person) == kind
        person.drive(2.3, how=by(Action.FORWARD, 1.0))
        person.now_s += 60  # the pilot reads the next instruction
    assert person.session.step is SessionStep.QUESTIONS
    assert sum(event.event == "phase_ended" for event in person.events) == 3
    faster = begun(pace=30.0)  # of tests
    faster.drive(3.3, how=pilot(Action.FORWARD, 1.0))
    assert phase(faster) == "correct"


def test_a_robot_differs_by_the_thresholds_between_the_pilots_turns_and_its_own():
    alike = turning(robot_turns_at_m=0.2)
    assert (alike["ssd"], alike["interventions"], alike["examples"]) == (0.0, 1, 7)
    assert len(alike["pilot"]["left"]) == len(alike["robot"]["left"]) == 201
    json.dumps(alike, allow_nan=False)
    # P(d < c) differs by 1 for c = 0.22, 0.24, ..., 0.60: twenty thresholds.
    assert turning(robot_turns_at_m=0.61)["ssd"] == pytest.approx(20.0)
    blind = outcome_of((91, pilot(Action.FORWARD, None)), (400, robot(Action.FORWARD, None)))
    assert blind["ssd"] is None, "without a sonar there is no profile"


@pytest.mark.parametrize("trial", TRIALS)
@pytest.mark.parametrize(("teach_s", "correct_s"), [(90, 330), (180, 240)])
def test_each_trial_is_a_plan_of_one_part_with_one_question(trial, teach_s, correct_s):
    plan = parse_plan(trial_plan(trial, teach_s))
    (condition,) = plan.conditions
    assert [phase.seconds for phase in condition.phases] == [teach_s, correct_s, 60]
    assert (condition.world, condition.moves) == TRIALS[trial]
    assert [question.name for question in plan.questions] == ["closing"]
    assert plan.shows_result and not plan.consent and plan.participants == MOST_PARTICIPANTS


@pytest.mark.parametrize(("trial", "teach_s"), [(4, 90), (1, 60), ("1", 90), (True, 90), (1, [])])
def test_there_is_no_other_trial(trial, teach_s):
    with pytest.raises(ConfigurationError):
        trial_plan(trial, teach_s)
