"""When the robot counts as ready, what resets that, and which gap each place has."""

from __future__ import annotations

import pytest

from robot.coaching.gaps import GapKind, Stage
from robot.coaching.lesson import EARLY_STARTS, STARTS, TAUGHT_S, Lesson
from robot.coaching.trial_drive import CLEAN_S, HARDLY_KNOWN
from robot.control.state import Tick
from robot.driver import Sensors
from robot.policy.events import Replaced, Taught
from robot.types import (
    Action,
    Decision,
    DrivenBy,
    Example,
    Mode,
    Prediction,
    StopReason,
)
from tests.kit.frames import jpeg_frame
from tests.kit.sizes import crossed

F, L, R, STOP = Action.FORWARD, Action.LEFT, Action.RIGHT, Action.STOP


class Drive:
    """A lesson of ticks at a given rate, and the resulting readiness."""

    def __init__(self, rate_hz=10.0):
        self.lesson = Lesson()
        self.dt_s, self.now_s, self.number = 1 / rate_hz, 100.0, 0

    def tick(self, who, action, proposed, *, events=(), is_new=True, stop_reason=None, **seen):
        self.now_s += self.dt_s
        self.number += is_new
        prediction = Prediction(
            frame_id=self.number, action=proposed, confidence=1.0, probabilities={}, **seen
        )
        decision = Decision(
            action=action, driven_by=who, mode=Mode.AUTONOMOUS, stop_reason=stop_reason
        )
        self.lesson.note(
            Tick(
                now_s=self.now_s,
                frame=jpeg_frame(self.number, self.now_s, b"") if is_new else None,
                decision=decision,
                sent=action,
                prediction=prediction,
                sensors=Sensors(distance_m=0.3),
                history_events=tuple(events),
            )
        )

    def teach(self, action, seconds, proposed=None, *, novelty=0.0, **example):
        example = {"is_intervention": False, **example, "label": action}
        for _ in range(round(seconds / self.dt_s)):
            taught = Example(frame_id=self.number + 1, **example)
            event = Taught(example=taught, x=None, at_s=self.now_s + self.dt_s)
            self.tick(DrivenBy.PILOT, action, proposed or action, novelty=novelty, events=[event])

    def correct(self, action, seconds, proposed=None, **seen):
        self.teach(action, seconds, proposed, is_intervention=True, **seen)

    def alone(self, seconds, action=F, **seen):
        for _ in range(round(seconds / self.dt_s)):
            self.tick(DrivenBy.ROBOT, action, action, **seen)

    @property
    def stage(self):
        return self.lesson.stage

    @property
    def kinds(self):
        return [gap.kind for gap in self.lesson.missing()]


def taught(rate_hz=10.0):
    drive = Drive(rate_hz)
    for _ in range(STARTS + 1):
        drive.teach(F, TAUGHT_S / (STARTS + 1))
        drive.teach(L, 2.0)
    return drive


def early(seconds, *, n_turns=EARLY_STARTS, novelty=0.0):
    """Teach this number of turns within this number of seconds."""
    drive = Drive()
    for _ in range(n_turns):
        for move in (F, L):
            drive.teach(move, seconds / n_turns / 2, novelty=novelty)
    return drive


# Taught enough to be tried ----------------------------------------------------------------------


def test_an_untaught_robot_needs_teaching_before_it_may_try():
    drive = Drive()
    [gap] = drive.lesson.missing()
    assert drive.stage is Stage.TEACH
    assert (gap.kind, gap.have, gap.need) == (GapKind.TOO_SHORT, 0, TAUGHT_S)


def test_a_robot_that_knows_the_views_and_was_shown_each_move_often_may_be_tried_early():
    assert early(24.0).stage is Stage.TRY
    for drive in (early(18.0), early(24.0, n_turns=EARLY_STARTS - 1), early(24.0, novelty=0.9)):
        assert drive.stage is Stage.TEACH
        assert GapKind.TOO_SHORT in drive.kinds
    single = Drive()
    for _ in range(EARLY_STARTS):
        single.teach(F, 6.0)
        for _ in range(10):
            single.tick(DrivenBy.NOBODY, STOP, F)
    assert single.stage is Stage.TEACH, "the trial needs more than one move"
    for late in (early(42.0, n_turns=EARLY_STARTS - 1), early(42.0, novelty=0.9)):
        assert late.stage is Stage.TRY, "the trial begins after forty seconds at the latest"


def test_corrections_at_new_views_do_not_take_the_early_trial_back():
    drive = early(24.0)
    for _ in range(3):
        drive.alone(2.0)
        drive.correct(L, 1.0, novelty=2.0)
    for touch_s in (0.2, 1.0):
        drive.correct(R, touch_s)  # a move that was never shown
        assert drive.stage is Stage.TRY and GapKind.TOO_SHORT not in drive.kinds
        drive.alone(CLEAN_S + 1)
        assert drive.stage is Stage.READY
    assert R in drive.lesson.moves_in_use
    drive.teach(F, 1.0)
    assert drive.stage is Stage.TRY, "R was only a correction, so the lesson does not ask for it"


def test_a_move_begun_too_few_times_is_named():
    drive = Drive()
    drive.teach(F, TAUGHT_S)
    drive.teach(R, 5.0)
    [gap] = [gap for gap in drive.lesson.missing() if gap.move is R]
    assert (gap.kind, gap.have, gap.need) == (GapKind.RARE_MOVE, 1, STARTS)


@pytest.mark.parametrize("straight_s", [60, 300, 900])
def test_a_pilot_who_drives_straight_for_minutes_is_told_which_turn_is_missing(straight_s):
    drive = Drive()
    for _ in range(STARTS):
        drive.teach(F, straight_s / STARTS)
        drive.teach(R, 0.5 if straight_s < 100 else 1.0)
    rare = [gap.move for gap in drive.lesson.missing() if gap.kind is GapKind.RARE_MOVE]
    assert rare == ([R] if straight_s > STARTS / 0.02 else [])
    for _ in range(STARTS):
        drive.teach(F, 1.0)
        drive.teach(R, 1.0)
    assert drive.stage is Stage.TRY


@crossed(rate_hz=[10, 15, 30], slip_s=[0.1, 0.2, 0.3], n_slips=[1, 2, 3, 4, 5])
def test_a_pilot_who_never_turns_left_is_not_asked_for_left_turns_despite_slips(
    rate_hz, slip_s, n_slips
):
    drive = Drive(rate_hz)
    for turn in range(14):
        drive.teach(F, 3.0)
        drive.teach(R, 3.0)
        if turn < n_slips:
            drive.teach(L, slip_s)
    assert drive.stage is Stage.TRY


# The trial --------------------------------------------------------------------------------------


@crossed(rate_hz=[10, 15, 30], unknown_s=[0.0, 0.5, 1.0, 1.5])
def test_a_robot_is_ready_exactly_after_the_announced_time_until_its_model_changes(
    rate_hz, unknown_s
):
    drive = taught(rate_hz)
    drive.teach(R, 0.3)  # a slip does not count as a move that must be taught
    assert drive.stage is Stage.TRY and R not in drive.lesson.moves_in_use
    drive.alone(unknown_s, novelty=HARDLY_KNOWN)
    trial = drive.lesson.trial
    while drive.stage is not Stage.READY:
        assert trial.clean_s < trial.needed_s
        drive.alone(1 / rate_hz)
        assert drive.now_s < 1000.0
    assert trial.clean_s >= trial.needed_s >= CLEAN_S
    assert unknown_s or drive.lesson.missing() == []
    drive.tick(DrivenBy.NOBODY, STOP, None, events=[Replaced(policy_name="x")])
    assert drive.stage is Stage.TEACH, "a new model starts from nothing"


@pytest.mark.parametrize(
    ("mistake", "kind"),
    [
        (lambda drive: drive.correct(L, 1.0), GapKind.CORRECTED),
        (lambda drive: drive.alone(0.6, is_stalled=True), GapKind.PUSHED),
        (
            lambda drive: drive.alone(0.2, STOP, stop_reason=StopReason.NEEDS_HELP),
            GapKind.HELPLESS,
        ),
    ],
)
def test_every_mistake_restarts_the_trial_and_is_shown_with_its_place(mistake, kind):
    drive = taught()
    drive.alone(CLEAN_S + 5)
    at_frame = drive.number
    mistake(drive)
    assert drive.stage is Stage.TRY
    newest = drive.lesson.missing()[0]
    assert (newest.kind, newest.distance_m) == (kind, 0.3)
    assert newest.frame.frame_id > at_frame
    drive.alone(CLEAN_S + 1)
    assert drive.stage is Stage.READY


def test_a_pilot_who_begins_with_what_the_robot_does_corrects_it_where_he_turns():
    drive = taught()
    drive.alone(5.0)
    drive.correct(F, 0.5)
    assert GapKind.CORRECTED not in drive.kinds
    drive.correct(L, 0.5, proposed=F)
    gap = drive.lesson.missing()[0]
    assert (gap.kind, gap.move, gap.instead) == (GapKind.CORRECTED, L, F)
    drive.alone(5.0)
    drive.correct(F, 0.5)
    drive.alone(1.0)
    assert drive.kinds.count(GapKind.CORRECTED) == 1


def test_a_robot_that_was_carried_to_another_place_shows_again_that_it_is_ready():
    drive = taught()
    drive.tick(DrivenBy.PILOT, L, F)
    drive.alone(CLEAN_S + 5)
    assert drive.stage is Stage.READY
    drive.lesson.note_carried()
    assert drive.stage is Stage.TRY and drive.lesson.trial.clean_s == 0.0
    assert drive.kinds == [], "gaps from the earlier place do not count"
    drive.alone(CLEAN_S + 1)
    assert drive.stage is Stage.READY


@crossed(novelty=[HARDLY_KNOWN, 1.0, 2.0], share=[0.1, 0.3, 1.0])
def test_hardly_known_views_delay_readiness_by_a_finite_time(novelty, share):
    drive = taught()
    for _ in range(100):
        drive.alone(1.0 - share)
        drive.alone(share, novelty=novelty)
        trial = drive.lesson.trial
        assert CLEAN_S <= trial.needed_s <= 2 * CLEAN_S
        assert trial.clean_s < trial.needed_s + 1.0
    assert drive.stage is Stage.TRY and GapKind.UNKNOWN_VIEW in drive.kinds
    known = taught()
    known.alone(CLEAN_S + 1, novelty=HARDLY_KNOWN - 0.01)
    assert known.stage is Stage.READY


def test_a_change_of_move_that_the_robot_did_not_foresee_is_shown_with_its_place():
    drive = taught()
    drive.teach(F, 2.0)
    drive.teach(L, 2.0, proposed=F)
    gap = drive.lesson.missing()[0]
    assert (gap.kind, gap.move, gap.instead) == (GapKind.UNFORESEEN, L, F)
    assert [*drive.lesson.foreseen].count(False) == 1


def test_a_gap_has_the_picture_of_its_place_although_its_tick_had_no_new_one():
    drive = Drive()
    drive.alone(1.0)
    seen = drive.number
    drive.tick(DrivenBy.PILOT, L, F, is_new=False)
    [corrected] = [gap for gap in drive.lesson.missing() if gap.kind is GapKind.CORRECTED]
    assert corrected.frame.frame_id == seen
