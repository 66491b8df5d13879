"""Ready means ready: what counts, what resets it, and that each gap has a location."""

from __future__ import annotations

import pytest

from robot.coaching.gaps import GapKind, Stage
from robot.coaching.lesson import EARLY_STARTS, STARTS, TAUGHT_S, Lesson
from robot.coaching.trial_drive import CLEAN_S, HARDLY_KNOWN
from robot.control.state import Tick
from robot.driver import Sensors
from robot.policy.events import Replaced, Taught
from robot.types import Action, Decision, DrivenBy, Example, Mode, Prediction, StopReason
from tests.kit.frames import jpeg_frame
from tests.kit.sizes import crossed

F, L, R, STOP = Action.FORWARD, Action.LEFT, Action.RIGHT, Action.STOP


class Drive:
    """Ticks at some rate, and the readiness that follows them."""

    def __init__(self, rate_hz: float = 10.0) -> None:
        self.lesson = Lesson()
        self.dt_s, self.now_s, self.number = 1 / rate_hz, 100.0, 0

    def tick(self, who, action, proposed, *, novelty=0.0, events=(), is_new=True, **flags) -> None:
        self.now_s += self.dt_s
        self.number += is_new
        reason = flags.pop("stop_reason", None)
        self.lesson.note(
            Tick(
                now_s=self.now_s,
                frame=jpeg_frame(self.number, self.now_s, b"") if is_new else None,
                decision=Decision(
                    action=action, driven_by=who, mode=Mode.AUTONOMOUS, stop_reason=reason
                ),
                sent=action,
                prediction=Prediction(
                    frame_id=self.number,
                    action=proposed,
                    confidence=1.0,
                    probabilities={},
                    novelty=novelty,
                    **flags,
                ),
                sensors=Sensors(distance_m=0.3),
                history_events=tuple(events),
            )
        )

    def teach(self, action, seconds, proposed=None, *, is_intervention=False, novelty=0.0) -> None:
        for _ in range(round(seconds / self.dt_s)):
            example = Example(
                frame_id=self.number + 1, label=action, is_intervention=is_intervention
            )
            event = Taught(example=example, x=None, at_s=self.now_s + self.dt_s)
            self.tick(DrivenBy.PILOT, action, proposed or action, novelty=novelty, events=[event])

    def alone(self, seconds, action=F, **flags) -> None:
        for _ in range(round(seconds / self.dt_s)):
            self.tick(DrivenBy.ROBOT, action, action, **flags)

    @property
    def kinds(self):
        return [gap.kind for gap in self.lesson.missing()]


def taught(rate_hz: float = 10.0) -> Drive:
    drive = Drive(rate_hz)
    for _ in range(STARTS + 1):
        drive.teach(F, TAUGHT_S / (STARTS + 1))
        drive.teach(L, 2.0)
    return drive


def early(seconds: float, *, n_turns: int = EARLY_STARTS, novelty: float = 0.0) -> Drive:
    """Teach this number of turns within this number of seconds."""
    drive = Drive(10.0)
    for _ in range(n_turns):
        drive.teach(F, seconds / n_turns / 2, novelty=novelty)
        drive.teach(L, seconds / n_turns / 2, novelty=novelty)
    return drive


def test_an_untaught_robot_needs_teaching_before_it_may_try() -> None:
    lesson = Lesson()
    [gap] = lesson.missing()
    assert lesson.stage is Stage.TEACH
    assert (gap.kind, gap.have, gap.need) == (GapKind.TOO_SHORT, 0, TAUGHT_S)


def test_it_may_be_tried_early_once_it_was_shown_each_move_often_and_knows_the_views() -> None:
    assert early(24.0).lesson.stage is Stage.TRY
    for drive in (early(18.0), early(24.0, n_turns=EARLY_STARTS - 1), early(24.0, novelty=0.9)):
        assert drive.lesson.stage is Stage.TEACH
        assert GapKind.TOO_SHORT in drive.kinds
    single = Drive(10.0)
    for _ in range(EARLY_STARTS):
        single.teach(F, 6.0)
        for _ in range(10):
            single.tick(DrivenBy.NOBODY, STOP, F)
    assert single.lesson.stage is Stage.TEACH, "a single move is not tried early"
    for late in (early(42.0, n_turns=EARLY_STARTS - 1), early(42.0, novelty=0.9)):
        assert late.lesson.stage is Stage.TRY, "never later than after forty seconds"


def test_corrections_at_new_views_do_not_take_the_early_trial_back() -> None:
    drive = early(24.0)
    for _ in range(3):
        drive.alone(2.0)
        drive.teach(L, 1.0, is_intervention=True, novelty=2.0)
    for touch_s in (0.2, 1.0):
        drive.teach(R, touch_s, is_intervention=True)  # a move that was never shown
        assert drive.lesson.stage is Stage.TRY and GapKind.TOO_SHORT not in drive.kinds
        drive.alone(CLEAN_S + 1)
        assert drive.lesson.stage is Stage.READY
    assert R in drive.lesson.moves_in_use
    drive.teach(F, 1.0)
    assert drive.lesson.stage is Stage.TRY, "R was only a correction, so it is not asked for"


@pytest.mark.parametrize("rate_hz", [10, 15, 30])
def test_after_a_clean_trial_it_is_ready_until_its_model_changes_at_any_frame_rate(rate_hz) -> None:
    drive = taught(rate_hz)
    drive.teach(R, 0.3)  # a slip of the finger is no move to be taught
    assert drive.lesson.stage is Stage.TRY
    assert R not in drive.lesson.moves_in_use
    drive.alone(CLEAN_S - 2)
    assert drive.lesson.stage is Stage.TRY
    drive.alone(3)
    assert drive.lesson.stage is Stage.READY
    assert drive.lesson.missing() == []
    drive.tick(DrivenBy.NOBODY, STOP, None, events=[Replaced(policy_name="x")])
    assert drive.lesson.stage is Stage.TEACH, "another model begins from nothing"


def test_a_move_begun_too_few_times_is_named() -> None:
    drive = Drive()
    drive.teach(F, TAUGHT_S)
    drive.teach(R, 5.0)
    [gap] = [gap for gap in drive.lesson.missing() if gap.move is R]
    assert (gap.kind, gap.move, gap.have, gap.need) == (GapKind.RARE_MOVE, R, 1, STARTS)


@pytest.mark.parametrize("straight_s", [60, 300, 900])
def test_a_pilot_who_drives_straight_for_minutes_is_told_which_turn_is_missing(straight_s) -> None:
    drive = Drive()
    for _ in range(STARTS):
        drive.teach(F, straight_s / STARTS)
        drive.teach(R, 0.5 if straight_s < 100 else 1.0)
    is_rare = straight_s > STARTS / 0.02
    assert [gap.move for gap in drive.lesson.missing() if gap.kind is GapKind.RARE_MOVE] == (
        [R] if is_rare else []
    )
    for _ in range(STARTS):
        drive.teach(F, 1.0)
        drive.teach(R, 1.0)
    assert drive.lesson.stage is Stage.TRY


def test_a_pilot_who_begins_with_what_the_robot_does_corrects_it_where_he_turns() -> None:
    drive = taught()
    drive.alone(5.0)
    drive.teach(F, 0.5, is_intervention=True)
    assert GapKind.CORRECTED not in drive.kinds
    drive.teach(L, 0.5, proposed=F, is_intervention=True)
    gap = drive.lesson.missing()[0]
    assert (gap.kind, gap.move, gap.instead) == (GapKind.CORRECTED, L, F)
    drive.alone(5.0)
    drive.teach(F, 0.5, is_intervention=True)
    drive.alone(1.0)
    assert drive.kinds.count(GapKind.CORRECTED) == 1


@crossed(rate_hz=[10, 15, 30], slip_s=[0.1, 0.2, 0.3], n_slips=[1, 2, 3, 4, 5])
def test_a_pilot_who_never_turns_left_is_not_asked_for_left_turns_despite_slips(
    rate_hz, slip_s, n_slips
) -> None:
    drive = Drive(rate_hz)
    for turn in range(14):
        drive.teach(F, 3.0)
        drive.teach(R, 3.0)
        if turn < n_slips:
            drive.teach(L, slip_s)
    assert drive.lesson.stage is Stage.TRY


@pytest.mark.parametrize(
    ("what", "kind"),
    [
        (lambda drive: drive.teach(L, 1.0, is_intervention=True), GapKind.CORRECTED),
        (lambda drive: drive.alone(0.6, is_stalled=True), GapKind.PUSHED),
        (
            lambda drive: drive.alone(0.2, STOP, stop_reason=StopReason.NEEDS_HELP),
            GapKind.HELPLESS,
        ),
    ],
)
def test_every_mistake_restarts_the_trial_and_is_shown_with_its_place(what, kind) -> None:
    drive = taught()
    drive.alone(CLEAN_S + 5)
    at_frame = drive.number
    what(drive)
    assert drive.lesson.stage is Stage.TRY
    newest = drive.lesson.missing()[0]
    assert newest.kind is kind
    assert newest.frame is not None and newest.frame.frame_id > at_frame
    assert newest.distance_m == 0.3
    drive.alone(CLEAN_S + 1)
    assert drive.lesson.stage is Stage.READY


def test_a_robot_that_was_carried_to_another_place_shows_again_that_it_is_ready() -> None:
    drive = taught()
    drive.tick(DrivenBy.PILOT, L, F)
    drive.alone(CLEAN_S + 5)
    assert drive.lesson.stage is Stage.READY
    drive.lesson.note_carried()
    assert drive.lesson.stage is Stage.TRY and drive.lesson.trial.clean_s == 0.0
    assert drive.kinds == [], "what went wrong is not in this place"
    drive.alone(CLEAN_S + 1)
    assert drive.lesson.stage is Stage.READY


@pytest.mark.parametrize("novelty", [HARDLY_KNOWN, 1.0, 2.0])
def test_a_view_that_it_hardly_knows_is_shown_and_keeps_it_from_ready(novelty) -> None:
    drive = taught()
    while drive.lesson.trial.clean_s < CLEAN_S + 1:
        drive.alone(3)
        drive.alone(0.5, novelty=novelty)
    assert drive.lesson.stage is Stage.TRY
    assert GapKind.UNKNOWN_VIEW in drive.kinds
    known = taught()
    known.alone(CLEAN_S + 1, novelty=HARDLY_KNOWN - 0.01)
    assert known.lesson.stage is Stage.READY


@crossed(rate_hz=[10, 15, 30], unknown_s=[0.0, 0.5, 1.0, 1.5])
def test_it_is_ready_exactly_after_the_time_that_it_named(rate_hz, unknown_s) -> None:
    drive = taught(rate_hz)
    drive.alone(unknown_s, novelty=HARDLY_KNOWN)
    while drive.lesson.stage is not Stage.READY:
        assert drive.lesson.trial.clean_s < drive.lesson.trial.needed_s
        drive.alone(1 / rate_hz)
        assert drive.now_s < 1000.0
    assert drive.lesson.trial.clean_s >= drive.lesson.trial.needed_s >= CLEAN_S


@pytest.mark.parametrize("share", [0.1, 0.3, 1.0])
def test_the_remaining_time_is_always_finite(share) -> None:
    drive = taught()
    for _ in range(300):
        drive.alone(1.0 - share)
        drive.alone(share, novelty=2.0)
        assert CLEAN_S <= drive.lesson.trial.needed_s <= 2 * CLEAN_S
        assert drive.lesson.trial.clean_s < drive.lesson.trial.needed_s + 1.0
    assert drive.lesson.stage is Stage.TRY


def test_a_change_of_move_that_the_robot_did_not_foresee_is_shown_with_its_place() -> None:
    drive = taught()
    drive.teach(F, 2.0)
    drive.teach(L, 2.0, proposed=F)
    gap = drive.lesson.missing()[0]
    assert (gap.kind, gap.move, gap.instead) == (GapKind.UNFORESEEN, L, F)
    seen = drive.lesson.foreseen
    assert sum(seen) == len(seen) - 1


def test_a_gap_has_the_picture_of_its_place_although_its_tick_had_no_new_one() -> None:
    drive = Drive()
    drive.alone(1.0)
    seen = drive.number
    drive.tick(DrivenBy.PILOT, L, F, is_new=False)
    [corrected] = [gap for gap in drive.lesson.missing() if gap.kind is GapKind.CORRECTED]
    assert corrected.frame is not None and corrected.frame.frame_id == seen
