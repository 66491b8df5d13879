"""A plan is read, or refused with a sentence that names the fault, the place and the remedy."""

import itertools
import tomllib
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.errors import ConfigurationError
from robot.study.builtin import TRIALS, paper_plan
from robot.study.plan import parse_plan, williams_rows

from .scripted import SMALL_PLAN, small_plan


@pytest.mark.parametrize("trial", TRIALS)
def test_the_papers_protocol_is_a_plan(trial):
    plan = parse_plan(paper_plan(trial))
    assert [c.name for c in plan.conditions] == ["teach-90", "teach-180"]
    for condition, times in zip(plan.conditions, ([90, 330, 60], [180, 240, 60]), strict=True):
        assert [phase.seconds for phase in condition.phases] == times
        assert (condition.world, condition.moves) == TRIALS[trial]
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
    ('name = "long"', 'name = "short"', r"two of the conditions are called 'short'; give each"),
    (LESSON, '"forward", "Left!"', r"the plan: 'Left!' is not a valid name of a move"),
    (LESSON, '"stop"', r"'moves' must have at least one move, and never 'stop'"),
    ('world = "box"', "", r"\[\[condition\]\] number 1: 'world' is missing"),
    ('["yes", "no"]', '["yes"]', r"number 2: 'options' must be a list of 2 to 20 texts"),
    (CHOICE, 'kind = "scale"', r"unknown field 'options'; known:"),
    ('name = "again"', 'name = "tlx_mental"', r"two of the questions are called 'tlx_mental'"),
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
def test_each_condition_stands_equally_often_at_each_place_and_after_each_other(n):
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
    names = ("short", "long"), ("long", "short")  # within participants
    assert [small_plan().order(slot) for slot in range(4)] == [*names, *names]
