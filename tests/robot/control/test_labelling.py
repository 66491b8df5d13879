"""Which frames get which label."""

from __future__ import annotations

from robot.control.online_learning import Labeller
from robot.types import Action, PilotCommand, Point

F, L = Action.FORWARD, Action.LEFT


def say(labeller: Labeller, held: Action | None, frame_id: int | None) -> list[tuple[int, Action]]:
    command = PilotCommand(held=held, frame_id=frame_id, seq=0, received_s=0.0)
    return [(frame, label) for frame, label, _ in labeller.label(command, range(1, 100))]


def test_the_frame_that_the_pilot_saw_gets_the_label() -> None:
    assert say(Labeller(), F, 10) == [(10, F)]


def test_frames_between_two_commands_carry_what_was_held_then() -> None:
    labeller = Labeller()
    say(labeller, F, 10)
    assert say(labeller, F, 13) == [(11, F), (12, F), (13, F)]
    assert say(labeller, L, 15) == [(14, F), (15, L)]


def test_nothing_held_labels_nothing() -> None:
    labeller = Labeller()
    assert say(labeller, None, 10) == []
    assert say(labeller, F, 12) == [(12, F)]


def test_letting_go_still_settles_the_frames_before() -> None:
    labeller = Labeller()
    say(labeller, F, 10)
    assert say(labeller, None, 13) == [(11, F), (12, F)]


def test_no_frame_is_labelled_twice() -> None:
    labeller = Labeller()
    say(labeller, F, 10)
    assert say(labeller, F, 10) == []
    assert say(labeller, L, 10) == []
    assert say(labeller, L, 9) == []
    labeller.reset()
    assert say(labeller, L, 10) == []


def test_a_new_drive_does_not_reach_back_into_the_one_before() -> None:
    labeller = Labeller()
    say(labeller, F, 10)
    labeller.reset()
    assert say(labeller, L, 20) == [(20, L)]


def test_frames_that_are_forgotten_or_unnamed_are_left_out() -> None:
    labeller = Labeller()
    assert say(labeller, F, None) == []
    command = PilotCommand(held=F, frame_id=5, seq=0, received_s=0.0)
    assert list(labeller.label(command, [])) == []


def test_each_frame_carries_the_point_that_was_held_with_its_label() -> None:
    labeller, mild, hard = Labeller(), Point(-0.3, 0.5), Point(-0.9, 0.4)
    for frame_id, point in ((10, mild), (13, hard)):
        command = PilotCommand(held=L, frame_id=frame_id, seq=0, received_s=0.0, point=point)
        labels = list(labeller.label(command, range(1, 100)))
    assert labels == [(11, L, mild), (12, L, mild), (13, L, hard)]
