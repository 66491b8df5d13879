"""A plan is read or refused with a sentence; the paper's trial is a built-in plan."""

import itertools
import json
import tomllib
from collections import Counter
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.errors import ConfigurationError
from robot.study.builtin import TRIALS, paper_plan, trial_plan
from robot.study.plan import MOST_PARTICIPANTS, parse_plan, williams_rows
from robot.study.rows import condition_logs, outcome
from robot.study.session import SessionStep
from robot.types import Action, DrivenBy, Mode

from .scripted import SMALL_PLAN, How, Participant, small_plan


@pytest.mark.parametrize("trial", TRIALS)
def test_the_papers_protocol_is_a_plan_for_a_study_and_for_one_person(trial):
    plan = parse_plan(paper_plan(trial))
    assert [c.name for c in plan.conditions] == ["teach-90", "teach-180"]
    for condition, times in zip(plan.conditions, ([90, 330, 60], [180, 240, 60]), strict=True):
        assert [phase.seconds for phase in condition.phases] == times
        assert (condition.world, condition.moves) == TRIALS[trial]
        alone = parse_plan(trial_plan(trial, times[0]))
        (only,) = alone.conditions
        assert [phase.seconds for phase in only.phases] == times
        assert (only.world, only.moves) == TRIALS[trial]
        assert [question.name for question in alone.questions] == ["closing"]
        assert alone.shows_result and not alone.consent
        assert alone.participants == MOST_PARTICIPANTS
    assert {"tlx_mental", "trust_reliable", "closing"} < {q.name for q in plan.questions}
    for question in plan.questions:
        for words in (question.text, question.low, question.high):
            assert set(words) == {"en", "es", "zh"} and all(words.values()), question.name


def test_a_condition_has_its_own_times_and_the_last_questions_come_at_the_end():
    plan = small_plan()
    windows = SMALL_PLAN.replace("\n", "\r\n")
    assert parse_plan(f"\ufeff{windows}") == plan
    assert [[p.seconds for p in c.phases] for c in plan.conditions] == [[3, 2, 2], [6, 2, 2]]
    assert [p.kind for p in plan.conditions[0].phases] == ["teach", "correct", "alone"]
    first, last = ({q.name for q in plan.questions_at(i, 2)} for i in (0, 1))
    assert last - first == {"remark"}


SECONDS, CHOICE, LESSON = "seconds = 3", 'kind = "choice"', '"forward", "left"'
FAULTS = [
    ('kind = "teach"', 'kind = "tech"', r"number 1: 'kind' must be 'teach', 'correct' or"),
    (SECONDS, "seconds = -3", r"\[\[phase\]\] number 1: 'seconds' must be a number above 0"),
    (SECONDS, "seconds = nan", r"'seconds' must be a number"),
    (SECONDS, "second = 3", r"number 1: unknown field 'second' \(did you mean 'seconds'"),
    ("title", "titel", r"the plan: unknown field 'titel' \(did you mean 'title'"),
    ("participants = 4", "participants = 0", r"'participants' must be .* from 1 to 500"),
    ("{ teach = 6 }", "{ teech = 6 }", r"number 2, seconds: unknown field 'teech' \(did you"),
    ('name = "long"', 'name = "short"', r"the name 'short' is used for two conditions; give each"),
    (LESSON, '"forward", "Left!"', r"the plan: 'Left!' is not a valid name of a move"),
    (LESSON, '"stop"', r"'moves' must name at least one move, and never 'stop'"),
    ('world = "box"', "", r"\[\[condition\]\] number 1: 'world' is missing"),
    ('["yes", "no"]', '["yes"]', r"number 2: 'options' must be a list of 2 to 20 texts"),
    (CHOICE, 'kind = "scale"', r"unknown field 'options'; known:"),
    ('name = "again"', 'name = "tlx_mental"', r"the name 'tlx_mental' is used for two questions"),
    ("title =", 'learner = "defalt-32"\ntitle =', r"'learner' is 'defalt-32', which is unknown"),
    ("title =", 'questionnaires = ["tlx"]\ntitle =', r"is named 'tlx'.*choose from: "),
    ('= "You may stop at any time."', '= { english = "x" }', r"has 'english', which is not a lan"),
    ('title = "Two times"', "", r"the plan: 'title' must be a text of at most 100"),
    ('text = "Anything else?"', "", r"number 1: 'text' must be a text, or one per language"),
    ('kind = "text"', "least = 5\nmost = 5", r"number 1: 'most' must be at least 'least' plus"),
    ("[[phase]]", "[phase]", r"not TOML|\[\[phase\]\]"),
    ('title = "Two times"', "title = ", r"is not TOML: .*line"),
    ("participants = 4", f"participants = {'9' * 5000}", r"the plan is not TOML: .*fix that line"),
    ("participants = 4", f"participants = {'[' * 20_000}", r"the plan is not TOML: .*fix that"),
]


@pytest.mark.parametrize(("right", "wrong", "sentence"), FAULTS, ids=range(len(FAULTS)))
def test_each_fault_is_named_where_it_is(right, wrong, sentence):
    assert right in SMALL_PLAN
    with pytest.raises(ConfigurationError, match=sentence):
        parse_plan(SMALL_PLAN.replace(right, wrong, 1))


_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=4,
)


@given(st.data())
def test_any_other_value_in_any_field_is_taken_or_refused_with_a_sentence(data):
    where = table = tomllib.loads(SMALL_PLAN)
    goes_deeper = True
    while goes_deeper:
        keys = sorted(where) if isinstance(where, dict) else range(len(where))
        key = data.draw(st.sampled_from(keys))
        is_table = isinstance(where[key], dict | list) and where[key]
        goes_deeper = is_table and data.draw(st.booleans())
        where, parent = where[key], where
    parent[key] = data.draw(_VALUES)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tomllib, "loads", lambda text: table if text == "drawn" else {})
        patch.setattr("robot.study.plan.questionnaires", dict)
        try:
            parse_plan("drawn")
        except ConfigurationError as error:
            assert str(error).startswith("the plan")


@pytest.mark.parametrize("n", range(1, 9))
def test_each_condition_is_equally_often_at_each_position_and_after_each_other_one(n):
    rows = williams_rows(n)
    assert all(sorted(row) == list(range(n)) for row in rows)
    places = Counter(place for row in rows for place in enumerate(row))
    assert set(places.values()) == {len(rows) // n}
    after = Counter(pair for row in rows for pair in itertools.pairwise(row))
    assert len(after) == n * (n - 1) and len(set(after.values())) <= 1


@pytest.mark.parametrize("n", range(1, 9))
def test_between_participants_each_meets_one_in_turn(n):
    conditions = "".join(f'[[condition]]\nname = "c{i}"\n' for i in range(n))
    phase = '[[phase]]\nkind = "teach"\nseconds = 1\n'
    plan = parse_plan(f'title = "x"\nworld = "box"\ndesign = "between"\n{phase}{conditions}')
    met = Counter(plan.order(slot) for slot in range(3 * n))
    assert met == {(f"c{i}",): 3 for i in range(n)}
    names = ("short", "long"), ("long", "short")  # the design is within participants
    assert [small_plan().order(slot) for slot in range(4)] == [*names, *names]


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
    person = begun(pace=5.0)
    for seconds, how in drives:
        person.drive(seconds / 5.0, how=how)
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
        person.now_s += 60  # for reading the next instruction
    assert person.session.step is SessionStep.QUESTIONS
    assert sum(event.event == "phase_ended" for event in person.events) == 3
    faster = begun(pace=30.0)
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


@pytest.mark.parametrize(("trial", "teach_s"), [(4, 90), (1, 60), ("1", 90), (True, 90), (1, [])])
def test_only_the_papers_trials_exist(trial, teach_s):
    with pytest.raises(ConfigurationError):
        trial_plan(trial, teach_s)
