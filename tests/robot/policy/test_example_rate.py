from __future__ import annotations

import json
import random
from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.policy.example_selection import ROOM_S, ExampleRate
from tests.robot.policy.passing import teach


def admits(rate, label, at_s):
    return teach(rate, label, at_s).is_learned


def learned(times_s):
    rate = ExampleRate()
    return [at_s for at_s in times_s if admits(rate, "FORWARD", at_s)]


def times_of(gaps_s):
    return list(accumulate(gaps_s[:-1], initial=0.0))


def unsteady(rate_hz, jitter, seed, seconds=20.0):
    """Return the times of frames that are early or late by up to a share of the frame period."""
    dice = random.Random(seed)
    return [
        (i + dice.uniform(-jitter, jitter)) / rate_hz for i in range(1, round(seconds * rate_hz))
    ]


@given(rate_hz=st.floats(10.0, 120.0), jitter=st.floats(0.0, 0.15), seed=st.integers(0, 99))
def test_any_camera_of_ten_frames_a_second_or_more_teaches_ten_a_second(rate_hz, jitter, seed):
    times_s = unsteady(rate_hz, jitter, seed)
    assert len(learned(times_s)) == pytest.approx(10.0 * (times_s[-1] - times_s[0]), abs=2.5)


@given(gaps_s=st.lists(st.floats(0.001, 0.5), min_size=2, max_size=80))
def test_never_more_than_ten_a_second(gaps_s):
    times_s = times_of(gaps_s)
    assert len(learned(times_s)) <= 10.0 * times_s[-1] + 1.5


@given(rate_hz=st.floats(0.5, 10.0))
def test_a_slower_camera_teaches_every_frame(rate_hz):
    times_s = [i / rate_hz for i in range(200)]
    assert learned(times_s) == times_s


def test_at_thirty_a_second_every_third_frame_is_learned():
    times_s = [i / 30 for i in range(900)]
    assert learned(times_s) == times_s[::3]


@given(st.lists(st.tuples(st.sampled_from("FLR"), st.floats(0.0, 0.3)), min_size=2, max_size=60))
def test_the_first_example_of_another_label_is_learned(steps):
    labels, times_s = [label for label, _ in steps], times_of([gap_s for _, gap_s in steps])
    rate = ExampleRate()
    admitted = [admits(rate, *example) for example in zip(labels, times_s, strict=True)]
    changes = [i for i in range(len(labels)) if i == 0 or labels[i] != labels[i - 1]]
    assert all(admitted[i] for i in changes)


@pytest.mark.parametrize("at_s", [5.0, 5.1, 20.0])
def test_a_pause_or_an_earlier_time_begins_anew(at_s):
    rate = ExampleRate()
    assert admits(rate, "FORWARD", 10.0)
    assert admits(rate, "FORWARD", at_s)
    assert not admits(rate, "FORWARD", at_s + 0.5 * ROOM_S)
    assert admits(rate, "FORWARD", at_s + ROOM_S)


def test_an_example_without_a_time_stands_for_itself():
    rate = ExampleRate()
    assert admits(rate, "FORWARD", 0.0)
    assert admits(rate, "FORWARD", None)
    assert admits(rate, "FORWARD", None)
    assert admits(rate, "FORWARD", 0.01), "nothing is known of the one before"
    assert not admits(rate, "FORWARD", 0.02)


@given(gaps_s=st.lists(st.floats(0.01, 0.3), min_size=2, max_size=60), cut=st.integers(0, 59))
def test_it_goes_on_where_it_was_saved(gaps_s, cut):
    one, other = ExampleRate(), ExampleRate()
    for i, at_s in enumerate(times_of(gaps_s)):
        if i == cut:
            other.load(json.loads(json.dumps(one.save()[0])), {})
        if i < cut:
            admits(one, "FORWARD", at_s)
        else:
            assert admits(one, "FORWARD", at_s) == admits(other, "FORWARD", at_s)
