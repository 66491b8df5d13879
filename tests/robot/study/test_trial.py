"""The paper's trial of one person, a built-in study: its phases, its clock, and its result."""

from __future__ import annotations

import json
from typing import Any

import pytest

from robot.errors import ConfigurationError
from robot.study.builtin import TRIALS, trial_plan
from robot.study.events import StudyEvent, write_events
from robot.study.plan import MOST_PARTICIPANTS, parse_plan
from robot.study.rows import condition_logs, outcome
from robot.study.session import SessionStep, StudySession
from robot.types import Action, DrivenBy, Mode

from .scripted import tick


class Drive:
    """A trial, with ten ticks a second from the end of the previous ones."""

    def __init__(self, trial: int = 1, teach_s: int = 90, pace: float = 1.0) -> None:
        self.plan = parse_plan(trial_plan(trial, teach_s))
        self.session = StudySession(self.plan, "T1", 0, pace=pace)
        self.now_s = 100.0
        self.events: list[StudyEvent] = []
        self.say("session_begun", value="0")
        self.say("condition_begun", attempt=1)

    def say(self, event: str, **fields: object) -> None:
        self.events.append(self.session.make(event, self.now_s, **fields))

    def forward(
        self, seconds: float, mode: Mode, by: DrivenBy, action: Action, distance_m: float | None
    ) -> None:
        for _ in range(round(seconds * 10)):
            self.now_s += 0.1
            made = tick(self.now_s, mode, by, action, distance_m)
            self.events += self.session.note(made, self.now_s, lambda: {"examples": "7"})

    @property
    def ended(self) -> int:
        return sum(event.event == "phase_ended" for event in self.events)

    @property
    def phase(self) -> str | None:
        return self.session.phase.kind if self.session.phase else None

    def outcome(self) -> dict[str, Any]:
        (log,) = condition_logs(self.plan, "T1", write_events(self.events, with_head=True).encode())
        return outcome(log)


TEACHING = (Mode.TRAIN, DrivenBy.PILOT)
ITSELF = (Mode.AUTONOMOUS, DrivenBy.ROBOT)


def teach_and_let_drive(robot_turns_at_m: float) -> Drive:
    drive = Drive()
    drive.forward(60, *TEACHING, Action.FORWARD, 1.0)
    drive.forward(31, *TEACHING, Action.LEFT, 0.2)
    drive.forward(300, *ITSELF, Action.FORWARD, 1.0)
    drive.forward(29, Mode.AUTONOMOUS, DrivenBy.PILOT, Action.LEFT, 0.3)
    drive.forward(41, *ITSELF, Action.FORWARD, 1.0)
    drive.forward(21, *ITSELF, Action.LEFT, robot_turns_at_m)
    return drive


def test_the_phases_follow_each_other_and_end_each() -> None:
    drive = Drive()
    for phase, seconds, how in (
        ("teach", 90, TEACHING),
        ("correct", 330, ITSELF),
        ("alone", 60, ITSELF),
    ):
        assert drive.phase == phase
        assert drive.session.left_s == pytest.approx(seconds, abs=1.0)
        drive.forward(seconds - 2, *how, Action.FORWARD, 1.0)
        assert drive.phase == phase
        drive.forward(2.3, *how, Action.FORWARD, 1.0)
        drive.now_s += 60  # the pilot reads the next instruction
    assert (drive.session.step, drive.ended) == (SessionStep.QUESTIONS, 3)


def test_a_robot_that_drives_alike_differs_by_nothing() -> None:
    result = teach_and_let_drive(robot_turns_at_m=0.2).outcome()
    assert (result["ssd"], result["interventions"], result["examples"]) == (0.0, 1, 7)
    assert len(result["pilot"]["left"]) == len(result["robot"]["left"]) == 201
    json.dumps(result, allow_nan=False)


def test_a_robot_that_turns_earlier_differs_by_the_thresholds_between() -> None:
    # P(d < c) differs by 1 for c = 0.22, 0.24, ..., 0.60: twenty thresholds.
    assert teach_and_let_drive(robot_turns_at_m=0.61).outcome()["ssd"] == pytest.approx(20.0)


def test_without_a_sonar_there_is_no_profile() -> None:
    drive = Drive()
    drive.forward(91, *TEACHING, Action.FORWARD, None)
    drive.forward(400, *ITSELF, Action.FORWARD, None)
    assert drive.outcome()["ssd"] is None


def test_a_test_clock_shortens_it() -> None:
    drive = Drive(3, 90, pace=30.0)
    drive.forward(3.3, *TEACHING, Action.FORWARD, 1.0)
    assert drive.phase == "correct"


@pytest.mark.parametrize("trial", TRIALS)
@pytest.mark.parametrize(("teach_s", "correct_s"), [(90, 330), (180, 240)])
def test_each_trial_is_a_plan_of_one_part_with_one_question(
    trial: int, teach_s: int, correct_s: int
) -> None:
    plan = parse_plan(trial_plan(trial, teach_s))
    (condition,) = plan.conditions
    assert [phase.seconds for phase in condition.phases] == [teach_s, correct_s, 60]
    assert (condition.world, condition.moves) == TRIALS[trial]
    assert [question.name for question in plan.questions] == ["closing"]
    assert plan.shows_result and not plan.consent and plan.participants == MOST_PARTICIPANTS


@pytest.mark.parametrize(
    ("trial", "teach_s"), [(0, 90), (4, 90), (1, 60), ("1", 90), (True, 90), (1, [])]
)
def test_there_is_no_other_trial(trial: Any, teach_s: Any) -> None:
    with pytest.raises(ConfigurationError):
        trial_plan(trial, teach_s)
