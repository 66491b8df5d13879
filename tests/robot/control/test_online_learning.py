"""Looking, proposing, and learning what the pilot did."""

from __future__ import annotations

import pytest

from robot.clock import ManualClock
from robot.control.online_learning import MEMORY_FRAMES, Apprentice
from robot.errors import CameraError
from robot.policy.registry import make_policy
from robot.types import Action, PilotCommand
from tests.robot.bench_robot import BenchCamera

F = Action.FORWARD


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock(50.0)


@pytest.fixture
def camera(clock: ManualClock) -> BenchCamera:
    return BenchCamera(clock)


@pytest.fixture
def apprentice(clock: ManualClock) -> Apprentice:
    return Apprentice(make_policy("published-8"), clock)


def hold(frame_id: int | None, now_s: float, action: Action = F) -> PilotCommand:
    return PilotCommand(held=action, frame_id=frame_id, seq=1, received_s=now_s)


def test_each_frame_is_looked_at_once(apprentice: Apprentice, camera: BenchCamera) -> None:
    assert not apprentice.look(None)
    frame = camera.show(1)
    assert apprentice.look(frame)
    assert not apprentice.look(frame)
    assert apprentice.prediction is not None
    assert apprentice.prediction.frame_id == frame.frame_id


def test_what_is_no_picture_does_not_count_as_seen(
    apprentice: Apprentice, camera: BenchCamera
) -> None:
    with pytest.raises(CameraError):
        apprentice.look(camera.show_rubbish())
    assert apprentice.frame is None


def test_a_lesson_may_be_passed_over_and_is_then_gone(
    apprentice: Apprentice, camera: BenchCamera
) -> None:
    frame = camera.show(1)
    apprentice.look(frame)
    apprentice.learn([hold(frame.frame_id, 50.0)], is_intervention=False, may_learn=False)
    apprentice.learn([hold(frame.frame_id, 50.1)], is_intervention=False, may_learn=True)
    assert apprentice.school.lessons == 0
    assert apprentice.agreement is None


def test_it_remembers_only_the_newest_frames(apprentice: Apprentice, camera: BenchCamera) -> None:
    first = camera.show(0)
    apprentice.look(first)
    for scene in range(MEMORY_FRAMES):
        apprentice.look(camera.show(scene))
    apprentice.learn([hold(first.frame_id, 50.0)], is_intervention=False, may_learn=True)
    assert apprentice.school.lessons == 0


def test_the_age_of_the_picture_that_the_pilot_saw(
    apprentice: Apprentice, camera: BenchCamera, clock: ManualClock
) -> None:
    assert apprentice.picture_age_s(hold(1, 50.0)) is None
    frame = camera.show(1)
    apprentice.look(frame)
    clock.advance(0.25)
    assert apprentice.picture_age_s(hold(frame.frame_id, clock.now_s())) == pytest.approx(0.25)
    assert apprentice.picture_age_s(hold(None, clock.now_s())) is None


def test_the_frame_rate_is_that_of_the_camera(
    apprentice: Apprentice, camera: BenchCamera, clock: ManualClock
) -> None:
    for scene in range(5):
        clock.advance(0.1)
        apprentice.look(camera.show(scene))
    assert apprentice.frame_rate_hz == pytest.approx(10.0)
