"""A session can be resumed from its log. A log is read as it was written, or refused."""

import csv
import io
import json
import random
import re
import zipfile

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from robot.errors import ConfigurationError, RecordingError
from robot.study.archive import pack, rebuild
from robot.study.events import StudyEvent, read_events, recordings_in, write_events
from robot.study.rows import condition_logs, outcome
from robot.study.session import SessionStep, StudySession, follow_log
from robot.types import Mode
from tests.kit.sizes import size

from .scripted import SMALL_PLAN, Participant, driving, logs_of, small_plan


def standing(session: StudySession) -> tuple[object, ...]:
    """The session's position without the clock's fraction, which is not logged."""
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


def test_a_truncated_log_loses_only_its_last_line():
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


_TEXTS = st.text(st.characters(codec="utf-8", exclude_characters="\r\n\0")) | st.text(
    st.sampled_from("=+-@'; \t＝x\"|"), max_size=8
)
_FORMULA = re.compile(r"[ '\"]*[=+\-@＝＋－＠]")


@given(_TEXTS, _TEXTS)
@example("=1+1", "@SUM(1)")
@example("'=x", "yes;=1")
def test_a_text_survives_a_round_trip(name, value):
    event = StudyEvent(wall_s=1.0, event="answer", name=name, value=value)
    assert read_events(write_events([event], with_head=True).encode()) == [event]


@given(_TEXTS)
@example("=cmd|' /C calc'!A0")
@example("yes;=1+1")
def test_no_cell_is_a_formula_whatever_separates_cells(text):
    written = write_events([StudyEvent(wall_s=1.0, event="answer", value=text)])
    for separator in ",;\t":
        for line in csv.reader(io.StringIO(written), delimiter=separator):
            assert not [cell for cell in line if _FORMULA.match(cell) and cell[0] != "'"]


def test_an_answer_like_a_formula_is_not_one_in_any_file_of_the_zip():
    person = driving(30.0)
    for question in person.session.questions:
        value = "=HYPERLINK(1)" if question.kind == "text" else question.check(question.least)
        person.say("answer", name=question.name, value=value)
    person.say("answer", name="remark", value="=HYPERLINK(1)")
    older = person.log.replace(b"'=HYPERLINK", b"=HYPERLINK")  # a log of an older version
    with zipfile.ZipFile(io.BytesIO(pack(SMALL_PLAN, {"P01": older}))) as packed:
        assert packed.read("events/P01.csv") == person.log
        for name in packed.namelist():
            text = packed.read(name).decode()
            assert not re.search(r"(^|,)\"?=HYPERLINK", text, re.M), name
            assert "HYPERLINK" in text or name != "events/P01.csv"


def test_a_log_that_is_damaged_anywhere_is_read_or_refused():
    """Whatever a file contains, the page gets a sentence, or numbers that JSON can represent."""
    plan, dice = small_plan(), random.Random(4)
    whole = logs_of(1)["P01"].split(b"\n")
    odd = [b"nan", b"inf", b"1e999", b"-1", b"9" * 5000, b"", b"x", b"\0", b"Left!", b"\xff", b"0"]
    odd += [b" -5", b"-6e10", b"-2.5e11", b"2.5e11", b"5e-324", b"1e-310", b"1_0"]
    refused = 0
    part = whole[:200] + whole[-40:]
    numbers = [n for n, line in enumerate(part) if b",measure," in line or b",answer," in line]
    turns = size("LOGS", 90, 300)
    for turn in range(turns):
        lines = [*part]
        for _ in range(dice.randint(1, 3)):
            row = dice.choice(numbers) if turn % 3 == 0 else dice.randrange(len(lines) - 1)
            fields = lines[row].split(b",")
            fields[dice.randrange(len(fields))] = dice.choice(odd)
            lines[row] = b",".join(fields)
        log = b"\n".join(lines)
        try:
            rebuild(SMALL_PLAN, {"P01": log})
            follow_log(plan, "P01", read_events(log))
            for condition in condition_logs(plan, "P01", log):
                json.dumps(outcome(condition), allow_nan=False)
        except RecordingError:
            refused += 1
    assert turns / 3 < refused < turns
    head, *rest = whole[:-1]
    early = b"\n".join([head, *(b"-6e10," + line.split(b",", 1)[1] for line in rest), b""])
    with pytest.raises(RecordingError, match="is missing or negative"):
        rebuild(SMALL_PLAN, {"P01": early})


def test_recordings_are_found_in_a_damaged_log_and_in_no_answer():
    person = Participant(small_plan())
    person.say("recording", value="2026-01-02_030405_678")
    person.say("answer", name="remark", value="recording,2026-09-09_090909_999")
    log = person.log + b"\xff\xfe,frame\n" + person.log + b"1.0,recording,0,,0,,,,,,,2026\n"
    assert recordings_in(log) == ["2026-01-02_030405_678"]
