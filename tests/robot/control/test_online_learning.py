"""The loop's learning: feature vectors, proposals, and the examples from the pilot's moves."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from robot.control.online_learning import Agreement, Labeller, OnlineLearning
from robot.errors import CameraError
from robot.policy.registry import make_policy
from robot.policy.undo import undo_examples
from robot.testing import VirtualClock
from robot.types import Action, Frame, PilotCommand, Point
from tests.robot.bench_robot import BenchCamera

F, L = Action.FORWARD, Action.LEFT

# Which frames get which label -------------------------------------------------------------------

NEW_DRIVE = "new drive"


BETWEEN = [(10, F), (11, F), (12, F), (13, F), (14, F), (15, L)]
LABELLED = {
    "the frame that the pilot saw": ([(F, 1)], [(1, F)]),
    "those between two commands, by what was held": ([(F, 10), (F, 13), (L, 15)], BETWEEN),
    "none while nothing is held": ([(None, 10), (F, 12)], [(12, F)]),
    "those before letting go": ([(F, 10), (None, 13)], [(10, F), (11, F), (12, F)]),
    "none twice": ([(F, 10), (F, 10), (L, 10), (L, 9), NEW_DRIVE, (L, 10)], [(10, F)]),
    "none between two drives": ([(F, 10), NEW_DRIVE, (L, 20)], [(10, F), (20, L)]),
    "none that is unnamed or forgotten": ([(F, None), (F, 100)], []),
}


@pytest.mark.parametrize(("told", "labels"), LABELLED.values(), ids=LABELLED)
def test_frames_are_labelled_with_the_held_move(told, labels):
    labeller, found = Labeller(), list[tuple[int, Action]]()
    for word in told:
        if isinstance(word, str):
            labeller.reset()
        else:
            command = PilotCommand(held=word[0], frame_id=word[1], seq=0, received_s=0.0)
            found += [(frame, label) for frame, label, _ in labeller.label(command, range(1, 100))]
    assert found == labels


def test_each_frame_carries_the_point_that_was_held_with_its_label():
    labeller, mild, hard = Labeller(), Point(-0.3, 0.5), Point(-0.9, 0.4)
    for frame_id, point in ((10, mild), (13, hard)):
        command = PilotCommand(held=L, frame_id=frame_id, seq=0, received_s=0.0, point=point)
        labels = list(labeller.label(command, range(1, 100)))
    assert labels == [(11, L, mild), (12, L, mild), (13, L, hard)]


# Agreement --------------------------------------------------------------------------------------


@given(
    st.lists(
        st.tuples(st.floats(0.0, 3.0), st.booleans(), st.none() | st.floats(0.0, 20.0)), max_size=60
    )
)
@example([(0.0, True, None), (10.0, False, None)])
def test_the_agreement_is_that_of_the_last_ten_seconds_without_what_was_undone(steps):
    agreement, kept, now_s = Agreement(), list[tuple[float, bool]](), 0.0
    for gap_s, is_right, undone_s in steps:
        now_s += gap_s
        agreement.add(now_s, is_right=is_right)
        kept = [(at_s, right) for at_s, right in kept if at_s > now_s - 10.0]
        kept.append((now_s, is_right))
        if undone_s is not None:
            now_s = max(now_s - undone_s, 0.0)
            agreement.drop_after(now_s)
            kept = [(at_s, right) for at_s, right in kept if at_s <= now_s]
        rights = [right for _, right in kept]
        assert agreement.n_examples == len(kept)
        assert agreement.share == (sum(rights) / len(rights) if rights else None)


# Frames and commands ----------------------------------------------------------------------------


@pytest.fixture
def camera():
    return BenchCamera(VirtualClock(50.0))


@pytest.fixture
def online_learning(camera):
    return OnlineLearning(make_policy("published-8"), camera.clock)


def learn(to: OnlineLearning, frame: Frame, action: Action = F, *, may_learn: bool = True) -> None:
    """Send a command of a pilot who holds this move and sees this frame."""
    command = PilotCommand(held=action, frame_id=frame.frame_id, seq=1, received_s=frame.captured_s)
    to.learn([command], is_intervention=False, may_learn=may_learn)


def test_each_frame_is_processed_once_unless_it_is_invalid(online_learning, camera):
    assert not online_learning.look(None)
    with pytest.raises(CameraError):
        online_learning.look(camera.show_rubbish())
    assert online_learning.frame is None
    frame = camera.show(1)
    assert online_learning.look(frame)
    assert not online_learning.look(frame)
    assert online_learning.prediction is not None
    assert online_learning.prediction.frame_id == frame.frame_id


def test_an_example_that_is_passed_over_is_not_learned_later(online_learning, camera):
    frame = camera.show(1)
    online_learning.look(frame)
    for may_learn in (False, True):
        learn(online_learning, frame, may_learn=may_learn)
    assert online_learning.history.taught.total() == 0
    assert online_learning.agreement.share is None


def test_only_the_newest_64_frames_can_be_labelled(online_learning, camera):
    frames = [camera.show(scene) for scene in range(65)]
    for frame in frames:
        online_learning.look(frame)
    for number in (0, 1):
        learn(online_learning, frames[number])
        assert online_learning.history.taught.total() == number


def test_the_times_of_a_frame_are_known_before_the_first_command(online_learning, camera):
    assert online_learning.times_of(1) is None
    frame, came_s = camera.show(1), camera.clock.now_s() + 0.25
    online_learning.look(frame, delivered_s=came_s)
    assert online_learning.times_of(frame.frame_id) == ((frame.captured_s, came_s), came_s)


def test_undone_examples_no_longer_count_in_the_agreement(online_learning, camera):
    for scene in range(80):
        camera.clock.sleep(0.1)
        frame = camera.show(scene % 4)
        online_learning.look(frame)
        learn(online_learning, frame, F if scene < 50 else L)
    assert (online_learning.agreement.share or 0.0) < 0.95
    assert online_learning.timings["learn"].count == 80
    undo_examples(online_learning.history, 3.05)
    online_learning.take_events()
    assert online_learning.agreement.n_examples == online_learning.history.taught.total()
    assert online_learning.agreement.share == pytest.approx(1.0, abs=0.03), "all but the first"
    online_learning.history.replace_policy(make_policy("published-8"))
    online_learning.take_events()
    assert online_learning.agreement.share is None
