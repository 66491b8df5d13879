from __future__ import annotations

import pytest

from robot.control.link_governor import LinkGovernor, age_of_link_s
from robot.control.state import CameraState, LinkLevel, LinkState
from robot.types import Action, PilotCommand


@pytest.mark.parametrize(
    ("threshold_s", "before", "level", "scale", "learns", "stops"),
    [
        (0.2, LinkLevel.GOOD, LinkLevel.SLOW, 1.0, True, False),
        (0.25, LinkLevel.SLOW, LinkLevel.CAPPED, 0.5, True, False),
        (0.3, LinkLevel.CAPPED, LinkLevel.NOT_LEARNING, 0.5, False, False),
        (0.5, LinkLevel.NOT_LEARNING, LinkLevel.TOO_SLOW, 0.5, False, True),
    ],
)
def test_a_delay_above_a_threshold_restricts_the_robot_at_once(
    threshold_s, before, level, scale, learns, stops
):
    governor = LinkGovernor()
    governor.note_age(threshold_s, 0.0)
    assert governor.level is before
    governor.note_age(threshold_s + 0.01, 0.0)
    state = governor.state(0.0)
    assert governor.level is state.level is level
    assert (state.speed_scale, state.may_learn, state.must_stop) == (scale, learns, stops)


def test_restrictions_are_lifted_one_by_one_and_only_after_a_while():
    governor = LinkGovernor()
    governor.note_age(0.4, 0.0)
    levels = []
    for tenth in range(1, 40):
        governor.note_age(0.03, tenth / 10)
        levels.append(governor.level)
    changes = [(i + 1) / 10 for i in range(1, 39) if levels[i] is not levels[i - 1]]
    assert changes == pytest.approx([1.1, 2.1, 3.1])
    assert levels[-1] is LinkLevel.GOOD


def test_only_a_delay_well_below_the_threshold_lifts_a_restriction():
    governor = LinkGovernor()
    governor.note_age(0.21, 0.0)
    for tenth in range(1, 60):  # below 0.2 s, but not by enough
        governor.note_age(0.19, tenth / 10)
    assert governor.level is LinkLevel.SLOW
    for tenth in range(60, 70):
        governor.note_age(0.16, tenth / 10)
    assert governor.level is LinkLevel.SLOW, "0.9 s are too short"
    governor.note_age(0.19, 7.0)  # the time before the level may fall starts again
    for tenth in range(71, 81):
        governor.note_age(0.16, tenth / 10)
    assert governor.level is LinkLevel.SLOW
    governor.note_age(0.16, 8.1)
    assert governor.level is LinkLevel.GOOD


def test_a_pilot_without_a_picture_for_half_a_second_counts_as_blind():
    governor = LinkGovernor()
    assert governor.blind_in_s(9.0) >= 0, "the page has not shown any picture yet"
    assert governor.state(9.0) == LinkState()
    governor.note_seen(1.0)
    for (now_s, *slack_s), is_blind in (
        ([1.5], False),
        ([1.51], True),
        ([1.6, 0.125], False),
        ([1.63, 0.125], True),
    ):
        assert (governor.blind_in_s(now_s, *slack_s) < 0) is is_blind
        assert governor.state(now_s, *slack_s).must_stop is is_blind
    governor.forget()
    assert governor.blind_in_s(9.0) >= 0


def test_the_age_is_that_of_the_slower_direction():
    assert age_of_link_s(0.4, None) == pytest.approx(0.4)
    assert age_of_link_s(0.4, 0.3) == pytest.approx(0.3)
    assert age_of_link_s(0.4, 0.05) == pytest.approx(0.35), "the command took long to arrive"
    assert age_of_link_s(0.1, 9.0) == pytest.approx(0.1), "the page's clock may be wrong"
    assert age_of_link_s(0.1, -9.0) == pytest.approx(0.1)
    assert age_of_link_s(0.4, 0.3, phone_s=0.1) == pytest.approx(0.2), "the phone caused the rest"
    assert age_of_link_s(0.4, 0.3, phone_s=9.0) == pytest.approx(0.1), "the way back always counts"
    assert age_of_link_s(0.4, 0.3, phone_s=-9.0) == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("frame_age_s", "phone_s", "age_s", "level"),
    [
        (0.78, None, 0.28, LinkLevel.SLOW),
        (0.78, 0.0, 0.28, LinkLevel.CAPPED),
        (0.78, 0.1, 0.18, LinkLevel.GOOD),
        (0.7, None, 0.2, LinkLevel.GOOD),
        (None, None, 0.28, LinkLevel.SLOW),
    ],
)
def test_a_command_is_judged_by_the_link_without_camera_and_phone(
    frame_age_s, phone_s, age_s, level
):
    """The camera delivered the picture after 0.5 s; of its period, 0.05 s are slack.

    If the page reports an age of 0.78 s, the link took 0.28 s, of which 0.1 s may be the phone's.
    """
    governor = LinkGovernor()
    command = PilotCommand(
        held=Action.FORWARD,
        frame_id=1,
        seq=1,
        frame_age_s=frame_age_s,
        phone_s=phone_s,
        received_s=11.28,
    )
    governor.judge(command, (10.5, 11.0), 10.9, CameraState(slack_s=0.05), 11.28)
    assert governor.age_s == pytest.approx(age_s)
    assert governor.level is level
    assert governor.blind_in_s(11.28) == pytest.approx(0.5 - 0.38), "0.38 s since that picture"


def test_a_computer_that_is_late_slows_the_robot_down_until_that_has_faded():
    governor = LinkGovernor()
    governor.note_lateness(0.1, is_to_blame=False)
    assert governor.state(0.0) == LinkState(
        level=LinkLevel.GOOD, is_busy=False, must_stop=False, may_learn=True, speed_scale=1.0
    ), "0.1 s is not busy"
    governor.note_lateness(0.2, is_to_blame=False)
    busy = LinkState(level=LinkLevel.GOOD, is_busy=True, speed_scale=0.5)
    for _ in range(50):
        governor.note_lateness(0.0, is_to_blame=True)
        assert governor.state(0.0) == busy, "nothing fades while the robot has to stand"
    for _ in range(6):
        governor.note_lateness(0.0, is_to_blame=False)
        assert governor.state(0.0) == busy
    governor.note_lateness(0.0, is_to_blame=False)
    assert governor.state(0.0) == LinkState(level=LinkLevel.GOOD)
