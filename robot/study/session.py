"""One participant's session: its state, and its next step. Pure.

The events determine the state, so a session is resumed by replaying its log.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from enum import StrEnum
from typing import Any

from robot.control.state import Tick
from robot.errors import ConfigurationError, RecordingError, told_as
from robot.study.events import StudyEvent, check_begun
from robot.study.plan import Condition, PlannedPhase, StudyPlan
from robot.study.questions import Question
from robot.types import Action, DrivenBy, Mode

LONGEST_STEP_S = 0.5
"""Maximum time between two ticks that counts as driving, in seconds. The rest is a pause."""


class SessionStep(StrEnum):
    """The step for which a session waits."""

    CONSENT = "consent"
    READY = "ready"
    """The session waits until the participant begins the next condition."""
    DRIVE = "drive"
    QUESTIONS = "questions"
    DONE = "done"


class StudySession:
    """Follows one session's events, and makes new ones.

    Args:
        plan: The study.
        participant: The participant's code.
        slot: The participant's number in the study, from 0. The slot determines the order of the
            conditions.
        pace: Speed of the phases. With a pace of 10, a phase of 60 s ends after 6 s. The pace is 1,
            except in demonstrations and tests.
    """

    def __init__(self, plan: StudyPlan, participant: str, slot: int, *, pace: float = 1.0) -> None:
        self.plan, self.participant, self.slot, self.pace = plan, participant, slot, pace
        self.order = plan.order(slot)
        self.step = SessionStep.CONSENT if plan.consent else SessionStep.READY
        self.position = 0
        """Index of the condition in the order, from 0."""
        self.phase_index = 0
        self.phase_s = 0.0
        self.attempt = 0
        self.answers: dict[str, str] = {}
        self._exact_s = 0.0
        self._last_s: float | None = None
        self._was_pilot = False
        self._mode: Mode | None = None

    # State ------------------------------------------------------------------------------------

    @property
    def condition(self) -> Condition:
        """The current condition; between two conditions, the next one."""
        return self.plan.by_name[self.order[min(self.position, len(self.order) - 1)]]

    @property
    def phase(self) -> PlannedPhase | None:
        """The current phase of a condition that has begun; None while the session waits for
        something else, such as answers."""
        return self.condition.phases[self.phase_index] if self.step is SessionStep.DRIVE else None

    @property
    def left_s(self) -> float:
        return max(0.0, self.phase.seconds - self.done_s) if self.phase else 0.0

    @property
    def done_s(self) -> float:
        return max(self._exact_s, self.phase_s)

    @property
    def questions(self) -> tuple[Question, ...]:
        """The questions after the current condition."""
        return self.plan.questions_at(self.position, len(self.order))

    def require(self, step: SessionStep) -> None:
        """Raise ConfigurationError unless the session waits for this step; the error names the
        awaited step."""
        if self.step is not step:
            raise ConfigurationError(
                f"the session of {self.participant} waits for {self.step.value!r}, "
                f"not {step.value!r}"
            )

    # Events -----------------------------------------------------------------------------------

    def make(self, event: str, wall_s: float, **fields: Any) -> StudyEvent:
        """Create an event at the session's current position, and apply it."""
        phase = None if event == "condition_begun" else self.phase
        made = StudyEvent(
            wall_s=round(wall_s, 3),
            event=event,
            position=min(self.position, len(self.order) - 1) + 1,
            condition=self.condition.name,
            attempt=self.attempt,
            phase=phase.name if phase else "",
            phase_s=round(self.done_s, 3) if phase else None,
        )
        made = replace(made, **fields)
        self.follow(made)
        return made

    def follow(self, event: StudyEvent) -> None:
        """Update the session's state by an event, which is new or comes from the log."""
        if event.phase_s is not None and self.phase is not None:
            self.phase_s = event.phase_s
        match event.event:
            case "consent":
                self.step = SessionStep.READY
            case "condition_begun":
                self.step, self.phase_index, self.attempt = SessionStep.DRIVE, 0, event.attempt
                self.answers = {}
                self._restart_clock(0.0)
            case "condition_resumed":
                self._restart_clock(self.phase_s)
            case "phase_ended":
                self.phase_index += 1
                if self.phase_index == len(self.condition.phases):
                    self.step = SessionStep.QUESTIONS
                self._restart_clock(0.0)
            case "answer":
                self.answers[event.name] = event.value
            case "answered":
                self.position, self.attempt = self.position + 1, 0
                is_over = self.position == len(self.order)
                self.step = SessionStep.DONE if is_over else SessionStep.READY

    def _restart_clock(self, phase_s: float) -> None:
        self.phase_s = self._exact_s = phase_s
        self._last_s = self._mode = None
        self._was_pilot = False

    def note(
        self, tick: Tick, wall_s: float, measure: Callable[[], Mapping[str, str]]
    ) -> list[StudyEvent]:
        """Return the events of one tick of the loop.

        Args:
            wall_s: Seconds since 1970.
            measure: Called at the end of a phase; returns the values to record.
        """
        phase = self.phase
        if phase is None:
            return []
        step_s = 0.0 if self._last_s is None else min(tick.now_s - self._last_s, LONGEST_STEP_S)
        self._last_s = tick.now_s
        events = []
        decision = tick.decision
        if decision.mode is not self._mode:
            self._mode = decision.mode
            reason = decision.stop_reason.value if decision.stop_reason else ""
            events.append(self.make("mode", wall_s, name=decision.mode.value, value=reason))
        if decision.mode is not phase.mode:
            self._was_pilot = False
            return events
        self._exact_s = min(self._exact_s + step_s * self.pace, phase.seconds)
        events += self._note_drive(tick, wall_s)
        if self._exact_s >= phase.seconds:
            events += [
                self.make("measure", wall_s, name=name, value=value)
                for name, value in measure().items()
            ]
            events.append(self.make("phase_ended", wall_s, phase=phase.name))
        return events

    def _note_drive(self, tick: Tick, wall_s: float) -> Iterable[StudyEvent]:
        by = tick.decision.driven_by
        is_pilot = by is DrivenBy.PILOT
        if is_pilot and not self._was_pilot and tick.decision.mode is Mode.AUTONOMOUS:
            yield self.make("intervention", wall_s, move=str(tick.sent))
        self._was_pilot = is_pilot
        if tick.frame is not None and tick.sent is not Action.STOP:
            distance_m = tick.sensors.distance_m
            yield self.make(
                "frame",
                wall_s,
                move=str(tick.sent),
                driven_by=by.value,
                distance_m=None if distance_m is None else round(distance_m, 4),
            )


def follow_log(plan: StudyPlan, participant: str, events: Iterable[StudyEvent]) -> StudySession:
    """Return a session in the state that its log describes. Raises RecordingError if the log does
    not belong to this plan."""
    events = list(events)
    where = f"the event log of {participant}"
    session = StudySession(plan, participant, check_begun(events, where))
    with told_as(RecordingError, f"{where} does not match its plan", KeyError, IndexError):
        for event in events[1:]:
            session.follow(event)
    return session
