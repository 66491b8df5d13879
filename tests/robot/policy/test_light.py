"""The policy adapts to the light, so a darker room does not count as another view."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.policy.recognition import ANOTHER_LIGHT, LightAdaptation
from robot.policy.registry import make_policy
from robot.types import Action
from tests.kit.frames import frame_of
from tests.kit.sizes import crossed
from tests.learners import installed
from tests.robot.policy.passing import see, teach

F, L = Action.FORWARD, Action.LEFT


def adaptation():
    return LightAdaptation(lambda x, gain: x * gain)


def taught(brightness):
    light = adaptation()
    for _ in range(50):
        teach(light, F, None, picture=np.full(4, brightness))
    return light


def gain_of(light, brightness, step_s=0.1):
    """Return the factor by which the learner's view is brighter than the frame."""
    seen = see(light, picture=np.full(4, brightness), step_s=step_s)
    return float(seen.x.mean()) / brightness


@given(taught_at=st.floats(10.0, 120.0), times=st.floats(0.1, 3.0))
def test_a_change_of_light_is_compensated_but_a_change_of_view_is_not(taught_at, times):
    assert gain_of(adaptation(), taught_at) == 1.0, "nothing is adapted before the first example"
    gain = gain_of(taught(taught_at), taught_at * times)
    if 1.0 / ANOTHER_LIGHT * 1.01 < times < ANOTHER_LIGHT / 1.01:
        assert gain == 1.0
    elif not 1.0 / ANOTHER_LIGHT * 0.99 < times < ANOTHER_LIGHT / 0.99:
        assert gain == pytest.approx(1.0 / max(times, 1.0 / taught_at))


@pytest.mark.parametrize("rate_hz", [5, 10, 30])
def test_a_dark_corner_does_not_count_as_a_change_of_light_at_any_frame_rate(rate_hz):
    light = taught(60.0)
    for brightness, seconds in ((60.0, 5.0), (20.0, 1.0), (60.0, 5.0)):
        for _ in range(round(seconds * rate_hz)):
            assert gain_of(light, brightness, 1 / rate_hz) == 1.0


def test_the_correction_is_saved_with_the_model_and_an_impossible_one_refused():
    light, copy = taught(60.0), adaptation()
    copy.load(*light.save())
    assert gain_of(copy, 20.0) == gain_of(light, 20.0) == 3.0
    for harm in ({"taught": -1.0}, {"examples": 1e9}, {"taught": float("nan")}):
        with pytest.raises(ValueError, match=r"taught|examples"):
            copy.load(light.save()[0] | harm, {})


def view(policy, kind, light, seed):
    """A picture of two plain halves, which differ mainly in brightness."""
    pixels = np.full((120, 160, 3), 150.0)
    pixels[:, 80 * kind : 80 * kind + 80] = 90.0
    pixels += np.random.default_rng(seed).normal(0.0, 6.0, pixels.shape)
    return policy.extract(frame_of((pixels * light).clip(0, 255)))


@crossed(light=[0.35, 0.5], without=installed("without-adaptation-8"))
def test_a_darker_room_does_not_count_as_a_new_view(without, light):
    novelty = {}
    for policy in (make_policy("default-8"), make_policy(without)):
        for number in range(60):
            kind = number // 10 % 2
            policy.learn(view(policy, kind, 1.0, number), (F, L)[kind], 0.1 * number)
        policy.reset()
        seen = [
            policy.propose(n, view(policy, n % 2, light, 1000 + n), at_s=20 + 0.1 * n)
            for n in range(20)
        ]
        novelty[policy.name] = float(np.median([prediction.novelty for prediction in seen]))
    assert novelty["default-8"] < 0.2 * novelty[without]
