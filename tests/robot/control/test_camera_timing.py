"""The limits adapt to the camera, and the robot drives and learns with fast and slow cameras."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.control.camera_timing import CameraTiming
from robot.control.config import CameraTimingConfig
from robot.control.state import USUAL_PERIOD_S, Tick
from robot.types import Action, Mode, PilotCommand, StopReason
from tests.kit.sizes import crossed, examples, few, size
from tests.robot.bench_robot import BenchRobot

SHORTEST_S = 0.2
FORWARD = Action.FORWARD


def _timing_of(period_s: float, age_s: float, frames: int = 60) -> CameraTiming:
    timing = CameraTiming(SHORTEST_S)
    for i in range(frames):
        timing.note(i * period_s, i * period_s + age_s, is_moving=False)
    return timing


@pytest.mark.parametrize(
    ("period_s", "age_s", "timeout_s", "speed_scale", "sight_slack_s"),
    [
        (1 / 30, 0.005, SHORTEST_S, 1.0, 0.0),
        (0.1, 0.145, 0.145 + 2.5 * 0.1, 1.0, 0.0),
        (0.4, 0.1, 0.5 + 0.1, 0.6, 0.4),
    ],
    ids=["fast", "a webcam on a brick, of which one picture may be lost", "slow"],
)
def test_a_camera_gets_enough_time_and_full_speed_unless_it_is_slow(
    period_s, age_s, timeout_s, speed_scale, sight_slack_s
):
    state = _timing_of(period_s, age_s).state
    assert state.timeout_s == pytest.approx(timeout_s)
    assert (state.speed_scale, state.delivery_age_s) == pytest.approx((speed_scale, age_s))
    assert state.slack_s == pytest.approx(max(0.0, period_s - USUAL_PERIOD_S))
    assert state.sight_slack_s == pytest.approx(sight_slack_s)


def test_the_rate_is_that_of_the_camera_and_a_pause_does_not_count():
    timing = CameraTiming(SHORTEST_S)
    assert (timing.rate_hz, timing.state.delivery_age_s) == (0.0, 0.0)
    for captured_s in (0.0, 0.1, 0.25, 0.3, 0.3):
        timing.note(captured_s, captured_s, is_moving=False)
    assert timing.rate_hz == pytest.approx(10.0)
    timing.pause()
    for number in range(16):
        timing.note(9.0 + number / 5, 9.0 + number / 5, is_moving=False)
        assert (timing.rate_hz == pytest.approx(5.0)) is (number == 15), "only 15 periods count"


@pytest.mark.parametrize(
    ("captured_s", "period_s", "is_slow"),
    [
        ((0.0, 0.75), 0.75, False),
        ((0.0, 0.75, 1.5), 0.75, True),
        ((0.0, 1.1, 5.0), 3.9, True),
        ((0.0, 0.3 / 0.05), 6.0, False),
    ],
)
def test_the_period_is_the_quartile_of_the_time_and_after_two_periods_a_slow_camera_is_named(
    captured_s, period_s, is_slow
):
    timing = CameraTiming(SHORTEST_S)
    for at_s in captured_s:
        timing.note(at_s, at_s, is_moving=False)
    assert timing.state.period_s == pytest.approx(period_s)
    assert (timing.fault is not None) is is_slow


@settings(deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(0.001, 3.0), st.floats(0.0, 3.0), st.booleans()),
        min_size=1,
        max_size=80,
    )
)
def test_the_limits_are_bounded_whatever_a_camera_does(pictures):
    timing, captured_s, delivered_s = CameraTiming(SHORTEST_S), 0.0, 0.0
    bound = CameraTimingConfig()
    for period_s, age_s, is_moving in pictures:
        before, since_s = timing.state, delivered_s
        captured_s += period_s
        delivered_s = max(delivered_s, captured_s + age_s)
        timing.note(captured_s, delivered_s, is_moving=is_moving)
        assert timing.state.timeout_s >= SHORTEST_S
        assert timing.state.timeout_s * timing.state.speed_scale <= bound.longest_timeout_s + 1e-9
        sight_s = timing.state.delivery_age_s + timing.state.period_s
        assert timing.state.speed_scale * sight_s <= max(bound.full_speed_s, 0.05 * sight_s) + 1e-9
        if is_moving:
            most_s = bound.growth_s_per_s * (delivered_s - since_s) + 1e-9
            assert timing.state.period_s <= before.period_s + most_s
            assert timing.state.delivery_age_s <= before.delivery_age_s + most_s


def test_the_allowed_delay_grows_slowly_while_moving_and_shrinks_at_once():
    timing = _timing_of(1 / 30, 0.005)
    at_s, ages = 2.0, []
    for _ in range(10):
        at_s += 0.1
        timing.note(at_s, at_s + 0.2, is_moving=True)
        ages.append(timing.state.delivery_age_s)
    assert ages == sorted(ages)
    assert ages[-1] < 0.08, "after one second, the robot does not yet accept an age of 200 ms"
    for _ in range(15):
        at_s += 1 / 30
        timing.note(at_s, at_s + 0.005, is_moving=True)
    assert timing.state.delivery_age_s == pytest.approx(0.005)
    assert timing.state.period_s == pytest.approx(USUAL_PERIOD_S)


def test_the_delivery_age_is_the_one_that_four_of_five_pictures_do_not_exceed():
    timing = CameraTiming(SHORTEST_S)
    for i in range(15):
        timing.note(i * 0.1, i * 0.1 + i * 0.01, is_moving=False)
    assert timing.state.delivery_age_s == pytest.approx(0.12)


@pytest.mark.parametrize("lost_every", [3, 7])
def test_a_lost_or_late_picture_now_and_then_changes_nothing(lost_every):
    timing = CameraTiming(SHORTEST_S)
    for i in range(60):
        if i % lost_every:
            timing.note(i * 0.1, i * 0.1 + (0.1 if i % 10 else 0.3), is_moving=False)
    assert timing.state.period_s == pytest.approx(0.1)
    assert timing.state.delivery_age_s == pytest.approx(0.1)


@pytest.mark.parametrize("pause_s", [10.0, 60.0, 3600.0])
def test_a_pause_of_the_camera_does_not_count_as_its_period(pause_s):
    timing = _timing_of(1 / 30, 0.005)
    before = timing.state
    for i in range(20):
        at_s = 2.0 + pause_s + i / 30
        timing.note(at_s, at_s + 0.005, is_moving=False)
        assert timing.state.timeout_s == before.timeout_s, "a long timeout would be dangerous"
        assert timing.state.speed_scale == 1.0
        assert timing.state.sight_slack_s == 0.0


@dataclass
class Drive:
    """The ticks of a drive, its number of pictures, and the reasons of its stops."""

    ticks: list[Tick] = field(default_factory=list)
    pictures: int = 0
    stops: list[StopReason | None] = field(default_factory=list)

    def moving(self, speed_scale: float = 0.0) -> float:
        """Return the share of time in which the robot drove at this share of full speed or more."""
        scales = [tick.decision.speed_scale for tick in self.ticks if tick.sent is FORWARD]
        return sum(scale >= speed_scale for scale in scales) / len(self.ticks)

    @property
    def taught(self) -> int:
        return sum(self.ticks[-1].taught.values())


def drive(
    period_s: float,
    age_s: float,
    *,
    jitter_s: float = 0.01,
    link_s: float = 0.02,
    phone_s: float = 0.01,
    burst: int = 1,
    seconds: float = 12.0,
    restarts: bool = True,
    seed: int = 1,
) -> Drive:
    """Hold forward for a while, like the page, with a simulated camera; in steps of 5 ms.

    The camera already runs for two seconds before the drive.
    """
    robot, dice = BenchRobot(), random.Random(seed)
    clock, result, step_s = robot.clock, Drive(), 0.005
    begin_s = clock.now_s()
    next_picture_s, arriving = begin_s, list[tuple[float, float, int]]()
    to_phone, to_robot = list[tuple[float, int, float]](), list[tuple[float, PilotCommand]]()
    screen: tuple[int, float] | None = None
    captured: dict[int, float] = {}
    next_beat_s, seq = begin_s, 0
    while clock.now_s() < begin_s + 2.0 + seconds:
        clock.advance(step_s)
        now_s = clock.now_s()
        is_driving = now_s >= begin_s + 2.0
        if now_s >= next_picture_s:
            late_s = age_s + dice.uniform(-jitter_s, jitter_s)
            for i in range(burst):
                taken_s = now_s + i / 1000
                arriving.append((taken_s + late_s, taken_s, dice.randrange(3)))
            next_picture_s += period_s
        while arriving and arriving[0][0] <= now_s:
            _, captured_s, scene = arriving.pop(0)
            frame = robot.camera.show(scene, captured_s=captured_s)
            captured[frame.frame_id] = captured_s
            to_phone.append((now_s + link_s + phone_s, frame.frame_id, now_s + link_s))
            result.pictures += is_driving
        while to_phone and to_phone[0][0] <= now_s:
            _, frame_id, arrived_s = to_phone.pop(0)
            screen = (frame_id, arrived_s)
        if now_s >= next_beat_s and screen is not None:
            next_beat_s += 0.1
            seq += 1
            command = PilotCommand(
                held=FORWARD if is_driving else None,
                frame_id=screen[0],
                seq=seq,
                received_s=now_s + link_s,
                frame_age_s=now_s - captured[screen[0]],
                phone_s=now_s - screen[1],
                proven_s=now_s - link_s - 0.05,
            )
            to_robot.append((now_s + link_s, command))
        while to_robot and to_robot[0][0] <= now_s:
            robot.loop.command(to_robot.pop(0)[1])
        if is_driving and robot.loop.mode is Mode.STOPPED and (not result.ticks or restarts):
            if result.ticks:
                result.stops.append(robot.loop.state.decision.stop_reason)
            robot.loop.set_mode(Mode.TRAIN)
        tick = robot.tick()
        if is_driving:
            result.ticks.append(tick)
    return result


@crossed(
    camera=[(0.1, 0.145), (0.1, 0.095), (0.1, 0.12), (1 / 30, 0.005), (1 / 15, 0.05)],
    jitter_s=[0.0, 0.01, 0.03],
)
def test_with_an_ordinary_camera_the_robot_drives_and_learns(camera, jitter_s):
    result = drive(*camera, jitter_s=min(jitter_s, camera[1]))
    assert not result.stops
    assert result.moving() >= 0.99
    assert result.moving(1.0) >= 0.9
    assert result.taught >= 0.98 * (result.pictures - 3), (result.taught, result.pictures)


@settings(deadline=None, max_examples=examples(30))
@given(st.floats(0.02, 1.2), st.integers(1, 8), st.floats(0.0, 0.15), st.integers(0, 999))
def test_a_camera_that_is_slow_or_sends_in_bursts_drives_slowly(pause_s, burst, age_s, seed):
    result = drive(
        pause_s,
        age_s,
        jitter_s=age_s / 4,
        burst=burst,
        seconds=float(size("DRIVE", 8, 20)),
        seed=seed,
    )
    assert not result.stops
    assert result.moving() >= 0.95
    assert result.taught >= 0.6 * result.pictures / burst - 3
    assert result.ticks[-1].decision.speed_scale <= max(0.3 / pause_s, 0.05) + 0.02


def test_the_robot_drives_slowly_with_pictures_300_ms_old_and_stands_with_600_ms():
    result = drive(0.1, 0.3)
    assert result.moving() >= 0.95
    assert result.moving(1.0) < 0.1
    assert 0.5 < result.ticks[-1].decision.speed_scale < 1.0
    assert drive(0.1, 0.6, restarts=False).moving() == 0.0


@pytest.mark.parametrize("phone_s", few([0.1, 0.2, 0.25], 2))
def test_with_a_slow_phone_pictures_are_skipped_but_no_examples(phone_s):
    result = drive(1 / 30, 0.005, phone_s=phone_s)
    assert not result.stops
    assert result.moving() >= 0.99
    assert result.moving(1.0) >= 0.99, "the link is good"
    assert result.taught >= 0.95 * (result.pictures - 30 * phone_s - 3)


def test_a_slow_link_of_the_same_age_is_not_taken_for_a_slow_phone():
    result = drive(1 / 30, 0.005, link_s=0.1)
    assert result.moving() >= 0.9
    assert drive(1 / 30, 0.005, link_s=0.4, restarts=False).moving() < 0.1


@crossed(age_s=[0.005, 0.095, 0.145, 0.3], period_s=[1 / 30, 0.1])
def test_after_the_camera_freezes_the_robot_stands_within_half_a_second_and_a_period(
    period_s, age_s
):
    robot = BenchRobot()
    clock, last_s = robot.clock, 0.0
    for i in range(100):
        clock.advance(period_s)
        robot.camera.show(i % 3, captured_s=clock.now_s() - age_s)
        last_s = clock.now_s() - age_s
        if i == 40:
            robot.loop.set_mode(Mode.AUTONOMOUS)
        robot.hold(FORWARD)
        tick = robot.tick()
    assert tick.sent is FORWARD
    camera = robot.loop.state.camera
    assert (camera.period_s, camera.delivery_age_s) == pytest.approx((period_s, age_s))
    while tick.sent is FORWARD:
        clock.advance(0.01)
        robot.hold(FORWARD)
        tick = robot.tick()
        assert clock.now_s() - last_s < 1.0, "the robot never stops"
    assert tick.decision.stop_reason is StopReason.FRAME_STALE
    assert clock.now_s() - last_s <= 0.5 + period_s
