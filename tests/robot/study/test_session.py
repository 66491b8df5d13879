"""A session goes through its steps, and can be resumed from its log at any moment."""

import random

import pytest

from robot.errors import ConfigurationError, RecordingError
from robot.study.events import read_events, write_events
from robot.study.session import SessionStep, StudySession, follow_log
from robot.types import Mode

from .scripted import Participant, driving, small_plan


def standing(session: StudySession) -> tuple[object, ...]:
    """The session's position; the fraction of the clock belongs to the running program."""
    return (
        *(session.step, session.order, session.position, session.phase_index, session.phase_s),
        *(session.attempt, session.answers),
    )


def test_a_session_can_be_resumed_from_any_line_of_its_log():
    plan = small_plan()
    person = Participant(plan, "P02", 1)
    person.take_part()
    session = StudySession(plan, "P02", 1)
    for n, event in enumerate(person.events):
        session.follow(event)
        if n % 7 == 0 or event.event != "frame":
            log = write_events(person.events[: n + 1], with_head=True).encode()
            assert standing(follow_log(plan, "P02", read_events(log))) == standing(session)
    ended = [e.condition for e in person.events if e.event == "phase_ended"]
    assert ended == ["long"] * 3 + ["short"] * 3 and session.order == ("long", "short")
    assert sum(e.event == "answered" for e in person.events) == 2


def test_a_log_cut_anywhere_loses_its_last_line_alone():
    person = Participant(small_plan())
    person.take_part()
    log, dice = person.log, random.Random(5)
    for _ in range(200):
        cut = dice.randrange(log.index(b"\n") + 1, len(log) + 1)
        assert read_events(log[:cut]) == person.events[: log[:cut].count(b"\n") - 1]


@pytest.mark.parametrize(
    "line", [b"1.0,dance,0,,0,,,,,,,\n", b"1.0,frame\n", b"x,mode,0,,0,,,,,,,\n", b"\xff\n"]
)
def test_an_invalid_log_is_refused_with_its_line(line):
    with pytest.raises(RecordingError, match=r"line 2|UTF-8"):
        read_events(write_events([], with_head=True).encode() + line)


def test_the_clock_stands_while_the_robot_is_in_another_mode():
    person = driving(1.0)
    left_s = person.session.left_s
    person.drive(30.0, Mode.STOPPED)
    person.drive(30.0, Mode.AUTONOMOUS)
    assert person.session.left_s == left_s
    assert sum(event.event == "mode" for event in person.events) == 3


def test_a_resumed_phase_continues_where_its_clock_stood_and_a_condition_can_begin_anew():
    person, again = driving(3.0 + 0.1 + 1.2), Participant(small_plan())
    again.session = follow_log(small_plan(), "P01", read_events(person.log))
    again.say("condition_resumed")
    assert again.session.phase is not None and again.session.phase.name == "correct"
    assert again.session.left_s == pytest.approx(person.session.left_s, abs=1e-3)
    person.begin()
    assert (person.session.attempt, person.session.phase_index) == (2, 0)
    assert person.session.left_s == 3.0


def test_no_step_is_possible_out_of_turn():
    session = StudySession(small_plan(), "P01", 0)
    with pytest.raises(ConfigurationError, match="P01 waits for 'consent', not 'drive'"):
        session.require(SessionStep.DRIVE)


def test_an_invalid_answer_is_refused_by_the_name_of_its_question():
    questions = {question.name: question for question in small_plan().questions}
    for name, answer in (
        *(("tlx_mental", 3), ("tlx_mental", 105), ("closing", True), ("closing", "7")),
        *(("again", 3), ("again", 0), ("remark", 5), ("remark", "x" * 1001)),
    ):
        with pytest.raises(ConfigurationError, match=f"the answer to '{name}' must be"):
            questions[name].check(answer)
