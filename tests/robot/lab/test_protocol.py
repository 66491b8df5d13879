from __future__ import annotations

import json

import pytest

from robot.control.state import Tick
from robot.errors import ConfigurationError
from robot.lab.protocol import Phase, StudyRun
from robot.types import Action, Decision, DrivenBy, Encoding, Frame, Mode, Sensors


def tick(now_s: float, mode: Mode, by: DrivenBy, action: Action, distance_m: float | None) -> Tick:
    frame = Frame(
        frame_id=1, captured_s=now_s, width=1, height=1, encoding=Encoding.RGB, data=b"\0\0\0"
    )
    return Tick(
        now_s=now_s,
        frame=frame,
        commands=(),
        refused=(),
        decision=Decision(action=action, driven_by=by, mode=mode),
        sent=action,
        prediction=None,
        sensors=Sensors(distance_m=distance_m),
        history_events=(),
        cycle_s=0.001,
    )


class Drive:
    """Ticks ten times a second from where the last ones ended."""

    def __init__(self, lesson: StudyRun) -> None:
        self.lesson, self.now_s, self.ended = lesson, 100.0, 0

    def forward(
        self, seconds: float, mode: Mode, by: DrivenBy, action: Action, distance_m: float | None
    ) -> None:
        for _ in range(round(seconds * 10)):
            self.now_s += 0.1
            self.ended += self.lesson.note(tick(self.now_s, mode, by, action, distance_m))


TEACHING = (Mode.TRAIN, DrivenBy.PILOT)
ITSELF = (Mode.AUTONOMOUS, DrivenBy.ROBOT)


def teach_and_let_drive(lesson: StudyRun, robot_turns_at_m: float) -> Drive:
    drive = Drive(lesson)
    drive.forward(60, *TEACHING, Action.FORWARD, 1.0)
    drive.forward(31, *TEACHING, Action.LEFT, 0.2)
    drive.forward(300, *ITSELF, Action.FORWARD, 1.0)
    drive.forward(31, Mode.AUTONOMOUS, DrivenBy.PILOT, Action.LEFT, 0.3)
    drive.forward(40, *ITSELF, Action.FORWARD, 1.0)
    drive.forward(21, *ITSELF, Action.LEFT, robot_turns_at_m)
    return drive


def test_the_phases_follow_each_other_and_stop_the_robot_each_time() -> None:
    lesson = StudyRun(1, 90)
    drive = Drive(lesson)
    for phase, seconds, how in (
        (Phase.TEACH, 90, TEACHING),
        (Phase.CORRECT, 330, ITSELF),
        (Phase.ALONE, 60, ITSELF),
    ):
        assert lesson.phase is phase
        assert lesson.left_s == pytest.approx(seconds, abs=1.0)
        drive.forward(seconds - 2, *how, Action.FORWARD, 1.0)
        assert lesson.phase is phase
        drive.forward(2.3, *how, Action.FORWARD, 1.0)
        drive.now_s += 60  # the pilot reads what comes next
    assert (lesson.phase, drive.ended) == (Phase.QUESTION, 3)


def test_the_clock_stands_while_the_robot_is_in_another_mode() -> None:
    lesson = StudyRun(2, 180)
    drive = Drive(lesson)
    drive.forward(10, *TEACHING, Action.FORWARD, 1.0)
    left_s = lesson.left_s
    drive.forward(30, Mode.STOPPED, DrivenBy.NOBODY, Action.STOP, 1.0)
    drive.forward(30, *ITSELF, Action.FORWARD, 1.0)
    assert lesson.left_s == left_s


def test_a_robot_that_drives_alike_differs_by_nothing() -> None:
    lesson = StudyRun(1, 90)
    teach_and_let_drive(lesson, robot_turns_at_m=0.2)
    lesson.judge(6)
    result = lesson.result()
    assert (result["ssd"], result["answer"], result["interventions"]) == (0.0, 6, 1)
    assert lesson.phase is Phase.DONE
    json.dumps(result, allow_nan=False)


def test_a_robot_that_turns_earlier_differs_by_the_thresholds_between() -> None:
    lesson = StudyRun(1, 90)
    teach_and_let_drive(lesson, robot_turns_at_m=0.61)
    # P(d < c) differs by 1 for c = 0.22, 0.24, ..., 0.60: twenty thresholds.
    assert lesson.result()["ssd"] == pytest.approx(20.0)


def test_without_a_sonar_there_is_no_profile() -> None:
    lesson = StudyRun(1, 90)
    drive = Drive(lesson)
    drive.forward(91, *TEACHING, Action.FORWARD, None)
    drive.forward(400, *ITSELF, Action.FORWARD, None)
    assert lesson.result()["ssd"] is None


def test_a_test_clock_shortens_it() -> None:
    lesson = StudyRun(3, 90, pace=30.0)
    Drive(lesson).forward(3.3, *TEACHING, Action.FORWARD, 1.0)
    assert lesson.phase is Phase.CORRECT


@pytest.mark.parametrize(("trial", "teach_s"), [(0, 90), (4, 90), (1, 60)])
def test_there_is_no_other_lesson(trial: int, teach_s: int) -> None:
    with pytest.raises(ConfigurationError):
        StudyRun(trial, teach_s)


@pytest.mark.parametrize("answer", [0, 8, True])
def test_the_answer_is_one_to_seven_and_comes_last(answer: int) -> None:
    lesson = StudyRun(1, 90)
    with pytest.raises(ConfigurationError):
        lesson.judge(4)
    teach_and_let_drive(lesson, 0.2)
    with pytest.raises(ConfigurationError):
        lesson.judge(answer)
