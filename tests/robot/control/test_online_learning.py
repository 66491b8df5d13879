"""Perception, proposals, and learning the pilot's moves."""

from __future__ import annotations

import pytest

from robot.control.online_learning import MEMORY_FRAMES, OnlineLearning
from robot.errors import CameraError
from robot.policy.registry import make_policy
from robot.testing import VirtualClock
from robot.types import Action, PilotCommand
from tests.robot.bench_robot import BenchCamera

F = Action.FORWARD


@pytest.fixture
def clock() -> VirtualClock:
    return VirtualClock(50.0)


@pytest.fixture
def camera(clock: VirtualClock) -> BenchCamera:
    return BenchCamera(clock)


@pytest.fixture
def online_learning(clock: VirtualClock) -> OnlineLearning:
    return OnlineLearning(make_policy("published-8"), clock)


def hold(frame_id: int | None, now_s: float, action: Action = F) -> PilotCommand:
    return PilotCommand(held=action, frame_id=frame_id, seq=1, received_s=now_s)


def test_each_frame_is_looked_at_once(online_learning: OnlineLearning, camera: BenchCamera) -> None:
    assert not online_learning.look(None)
    frame = camera.show(1)
    assert online_learning.look(frame)
    assert not online_learning.look(frame)
    assert online_learning.prediction is not None
    assert online_learning.prediction.frame_id == frame.frame_id


def test_what_is_no_picture_does_not_count_as_seen(
    online_learning: OnlineLearning, camera: BenchCamera
) -> None:
    with pytest.raises(CameraError):
        online_learning.look(camera.show_rubbish())
    assert online_learning.frame is None


def test_a_lesson_may_be_passed_over_and_is_then_gone(
    online_learning: OnlineLearning, camera: BenchCamera
) -> None:
    frame = camera.show(1)
    online_learning.look(frame)
    online_learning.learn([hold(frame.frame_id, 50.0)], is_intervention=False, may_learn=False)
    online_learning.learn([hold(frame.frame_id, 50.1)], is_intervention=False, may_learn=True)
    assert online_learning.history.n_examples == 0
    assert online_learning.agreement.share is None


def test_it_remembers_only_the_newest_frames(
    online_learning: OnlineLearning, camera: BenchCamera
) -> None:
    first = camera.show(0)
    online_learning.look(first)
    for scene in range(MEMORY_FRAMES):
        online_learning.look(camera.show(scene))
    online_learning.learn([hold(first.frame_id, 50.0)], is_intervention=False, may_learn=True)
    assert online_learning.history.n_examples == 0


def test_when_a_frame_was_taken_and_came_is_known_before_the_first_command(
    online_learning: OnlineLearning, camera: BenchCamera, clock: VirtualClock
) -> None:
    assert online_learning.times_of(1) is None
    frame = camera.show(1)
    online_learning.look(frame, delivered_s=clock.now_s() + 0.25)
    came_s = clock.now_s() + 0.25
    assert online_learning.times_of(frame.frame_id) == ((frame.captured_s, came_s), came_s)


def test_the_frame_rate_is_that_of_the_camera(
    online_learning: OnlineLearning, camera: BenchCamera, clock: VirtualClock
) -> None:
    for scene in range(5):
        clock.advance(0.1)
        online_learning.look(camera.show(scene))
    assert online_learning.frame_rate_hz == pytest.approx(10.0)


def test_what_is_undone_no_longer_counts_in_the_agreement(
    online_learning: OnlineLearning, camera: BenchCamera, clock: VirtualClock
) -> None:
    for scene in range(80):
        clock.advance(0.1)
        frame = camera.show(scene % 4)
        online_learning.look(frame)
        action = F if scene < 50 else Action.LEFT
        command = hold(frame.frame_id, clock.now_s(), action)
        online_learning.learn([command], is_intervention=False, may_learn=True)
    assert (online_learning.agreement.share or 0.0) < 0.95
    online_learning.history.undo(3.05)
    online_learning.take_events()
    assert online_learning.agreement.n_examples == online_learning.history.n_examples
    assert online_learning.agreement.share == pytest.approx(1.0, abs=0.03), "all but the first"
    online_learning.history.replace_policy(make_policy("published-8"))
    online_learning.take_events()
    assert online_learning.agreement.share is None
