"""Conducts one participant's session of a study: phases of driving, which end after a given time,
and questions.

A session can be resumed at any time, because its event log contains its whole state.
"""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, TypeVar, cast

from robot.control.state import Tick
from robot.devices.rig import Rig
from robot.errors import ConfigurationError, RobotError
from robot.study.builtin import trial_plan
from robot.study.events import StudyEvent
from robot.study.plan import Condition, parse_plan
from robot.study.session import SessionStep, StudySession, follow_log
from robot.types import Mode, StartStop
from server.persistence import Persistence
from server.study.event_log import EventLog
from server.study.folder import LONGEST_NAME, StudyFolder, fingerprint
from server.study.models import PATIENCE_S, SessionModels

log = logging.getLogger(__name__)
_Act = TypeVar("_Act", bound=Callable[..., Any])


def name_of_world(body: object) -> str | None:
    """Return the name of a simulated body's world; None for a real body.

    The function looks for an attribute instead of checking the class, because a server on a LEGO
    brick cannot import the simulator.
    """
    return cast(str, body.simulation.world.name) if hasattr(body, "simulation") else None


def check_body(body: Any, condition: Condition) -> None:
    """Raise ConfigurationError if a body is in another simulated world, or lacks a move."""
    here, place = name_of_world(body), condition.world
    worlds: Mapping[str, str] = getattr(body, "worlds", {place: place}) if here else {}
    file = os.path.realpath(place)  # a study's condition may name the world by its file
    place = next((name for name, at in worlds.items() if os.path.realpath(at) == file), place)
    if here not in (None, place):
        do = f"choose {place!r} under Settings, Place, while no session is running"
        if place not in worlds:
            do = (
                "this place is not offered under Settings: start the robot with --world and the "
                "world's TOML file"
            )
        raise ConfigurationError(
            f"this condition needs the world {condition.world!r}, but the robot is in {here!r}; "
            f"{do}"
        )
    missing = set(condition.moves) - set(body.moves)
    if missing:
        raise ConfigurationError(f"this robot lacks the moves {', '.join(sorted(missing))}")


def _in_turn(act: _Act) -> _Act:
    """Decorate a method so that calls run one after the other, even if two pages call at once."""

    @wraps(act)
    def serialized(self: Conductor, *args: Any, **named: Any) -> Any:
        with self._turn:
            return act(self, *args, **named)

    return cast(_Act, serialized)


class Conductor(StartStop):
    """Runs one session at a time. The methods of this class wait for the disk: never call them on
    an event loop.

    Args:
        rig: The robot.
        kept: Gives access to the data folder, the model in use and the current recording.
        announce: Called with each event for the clients.
    """

    def __init__(self, rig: Rig, kept: Persistence, announce: Callable[..., None]) -> None:
        self.folder = StudyFolder(kept.storage)
        self.pace = 1.0
        """Speed of the phases' clocks; other than 1 only in demonstrations and tests."""
        self.study: str | None = None
        self.session: StudySession | None = None
        self._rig, self._loop, self._clock = rig, rig.loop, rig.clock
        self._models = SessionModels(rig, self.folder, kept.autosave)
        self._kept, self._announce = kept, announce
        self._turn = self._clock.lock()
        self._log: EventLog | None = None
        self._episode: str | None = None
        self._unsubscribe: Callable[[], None] = lambda: None

    def start(self) -> None:
        try:
            self._models.put_away()
        except (RobotError, OSError, TimeoutError) as error:  # the robot starts nevertheless
            log.warning("a session's model is still in use: %s", error)

    def stop(self) -> None:
        """Leave the session, so that it can be resumed after the next start."""
        try:
            self._end("server_ended")
        except (RobotError, OSError, TimeoutError) as error:
            log.warning("the session's model will be put away at the next start: %s", error)

    @property
    def is_simulated(self) -> bool:
        """True if the robot is simulated; only then does the program know the robot's place."""
        return name_of_world(self._rig.driver) is not None

    @property
    def is_driving(self) -> bool:
        """True if the robot uses the session's own model; only then do the phases' clocks run."""
        return self._models.in_use is not None

    @property
    def fault(self) -> str:
        """Why the session's events cannot be saved; empty if they can."""
        return self._log.fault if self._log is not None else ""

    # Sessions ---------------------------------------------------------------------------------

    @_in_turn
    def begin_trial(self, trial: int, teach_s: int) -> StudySession:
        """Begin one of the paper's trials for one person, as a session of a built-in study."""
        learner = self._loop.state.learner
        text = trial_plan(trial, teach_s, learner)
        check_body(self._rig.driver, parse_plan(text).conditions[0])
        name = re.sub(r"[^\w.-]+", "-", f"trial-{trial}-{teach_s}-{learner}")[:LONGEST_NAME]
        if name not in self.folder.names():
            self.folder.create(name, text)
        taken = set(self.folder.codes(name))
        code = next(f"T{n}" for n in range(1, 10_000) if f"T{n}" not in taken)
        return self.begin(name, code)

    @_in_turn
    def begin(self, study: str, participant: str) -> StudySession:
        """Begin a participant's session, or resume it.

        Raises:
            ConfigurationError: If the session cannot begin. For example, another session is
                running, the study has no free place, or the plan has changed.
            NotFoundError: If there is no such study.
            RecordingError: If the plan or the event log cannot be read.
        """
        if self.session is not None:
            if self._is_on(study, participant):
                return self.session
            raise ConfigurationError(
                f"the session of {self.session.participant} is running; leave that session first"
            )
        text, plan = self.folder.plan_text(study), self.folder.plan(study)
        path = self.folder.log_path(study, participant)
        events = self.folder.events(study, participant)
        if events:
            if events[0].name != fingerprint(text):
                raise ConfigurationError(
                    f"the plan was changed after {participant} had begun; undo the change in "
                    "plan.toml, or create another study with the changed plan"
                )
            session = follow_log(plan, participant, events)
            if session.step is SessionStep.DONE:
                raise ConfigurationError(
                    f"the session of {participant} is finished; use the next participant's code"
                )
        else:
            free = self.folder.free_slots(study, plan)
            if not free:
                raise ConfigurationError(
                    f"all {plan.participants} places of the study are taken; withdraw a "
                    "participant, or create a study with more places"
                )
            session = StudySession(plan, participant, free[0])
        session.pace = self.pace
        event_log = EventLog(path, self._clock)
        event_log.start()
        self.study, self._log, self.session = study, event_log, session
        self._unsubscribe = self._loop.subscribe(self.note)
        if not events:
            self._happen("session_begun", name=fingerprint(text), value=str(session.slot))
            event_log.flush()
        self._tell()
        return session

    def _is_on(self, study: str, participant: str) -> bool:
        session = self.session
        return session is not None and (study, participant) == (self.study, session.participant)

    @_in_turn
    def consent(self, language: str) -> None:
        """Record that the participant has consented to the plan's text."""
        self._session().require(SessionStep.CONSENT)
        self._happen("consent", name=language[:2])
        self._flush()
        self._tell()

    @_in_turn
    def drive(self, *, confirmed: bool = False, anew: bool = False) -> None:
        """Begin the next condition with an empty model, or resume the condition that was left.

        Args:
            confirmed: The researcher confirms that a real robot is in the condition's place.
            anew: Begin the condition again; its earlier drives then do not count.

        Raises:
            ConfigurationError: If another step of the session is due, the robot is in the wrong
                place, or it lacks a move.
            OSError: If the disk cannot be written.
        """
        session = self._session()
        if session.step is not SessionStep.DRIVE:
            session.require(SessionStep.READY)
        elif self.is_driving and not anew:
            return
        condition = session.condition
        check_body(self._rig.driver, condition)
        if not (self.is_simulated or confirmed):
            raise ConfigurationError(
                f"confirm that the robot is in the place {condition.world!r}; the program "
                "cannot check this"
            )
        checker = "simulator" if self.is_simulated else "researcher"
        self._models.put_away()
        whose = (self.study or "", session.participant, session.position + 1)
        anew = anew or session.step is SessionStep.READY
        is_new = self._models.put_in_use(*whose, condition, anew=anew)
        self._episode = None
        fields = {"attempt": session.attempt + 1} if is_new else {}
        self._happen("condition_begun" if is_new else "condition_resumed", **fields)
        self._happen("world", name=checker, value=condition.world)
        self._flush()
        self._tell()

    @_in_turn
    def answer(self, answers: Mapping[str, Any], *, is_done: bool) -> None:
        """Save answers by the name of their question.

        With `is_done`, the questions end; raises ConfigurationError if an answer is missing.
        """
        session = self._session()
        session.require(SessionStep.QUESTIONS)
        questions = {question.name: question for question in session.questions}
        checked = {}
        for name, answer in answers.items():
            if name not in questions:
                raise ConfigurationError(f"there is no question {name[:40]!r}")
            checked[name] = questions[name].check(answer)
        missing = [n for n in questions if n not in checked and n not in session.answers]
        for name, value in checked.items():
            if session.answers.get(name) != value:
                self._happen("answer", name=name, value=value)
        if is_done:
            if missing:
                raise ConfigurationError(
                    f"these questions have no answer yet: {', '.join(missing)}"
                )
            self._happen("answered")
            if self._session().step is SessionStep.DONE:
                self._happen("session_ended")
            self._models.put_away()
            self._tell()
        self._flush()

    @_in_turn
    def leave(self) -> None:
        """Leave the session at any stage; `begin` resumes it. Idempotent.

        Raises OSError if the events cannot be written; the session then continues.
        """
        self._flush()
        self._end("left")

    @_in_turn
    def _end(self, why: str) -> None:
        session, event_log = self.session, self._log
        try:
            if session is not None and session.step is not SessionStep.DONE:
                self._happen("left", value=why)
            self._models.put_away()
        finally:
            self.session = self.study = self._log = None
            self._unsubscribe()
            if event_log is not None:
                event_log.stop()
        self._tell()

    @_in_turn
    def withdraw(self, study: str, participant: str) -> list[str]:
        """Permanently delete all data of a participant; see `StudyFolder.withdraw`."""
        if self._is_on(study, participant):
            raise ConfigurationError(
                "this participant's session is running; leave the session first"
            )
        return self.folder.withdraw(study, participant, self._kept.run)

    # Ticks ------------------------------------------------------------------------------------

    def note(self, tick: Tick) -> None:
        """Count one tick, on the loop's thread; stop the robot when a phase ends."""
        session, event_log = self.session, self._log
        if session is None or event_log is None or not (self.is_driving and session.phase):
            return
        wall_s = self._clock.wall_s()
        events: list[StudyEvent] = []
        episode = self._kept.run
        if episode is not None and episode != self._episode:
            self._episode = episode
            self._kept.keep_run()  # save the recording even if nobody teaches in it
            events.append(session.make("recording", wall_s, value=episode))
        events += session.note(tick, wall_s, self._measure)
        event_log.note(events)
        if any(event.event == "phase_ended" for event in events):
            self._episode = None  # the log of the next phase then names this recording, too
            self._loop.set_mode(Mode.STOPPED)
            self._tell()

    def _measure(self) -> dict[str, str]:
        state = self._loop.state
        measures = {"examples": str(sum(state.taught.values()))}
        if state.agreement is not None:
            measures["agreement"] = repr(float(state.agreement))
        return measures

    # Within -----------------------------------------------------------------------------------

    def _session(self) -> StudySession:
        if self.session is None:
            raise ConfigurationError("no session is running; begin one on the Studies screen")
        return self.session

    def _tell(self) -> None:
        """Tell every page to reload the state of the session."""
        self._announce("session", step=self.session.step.value if self.session else None)

    def _happen(self, event: str, **fields: Any) -> None:
        """Apply an event to the session between two ticks, and queue it for the log."""
        session, event_log = self._session(), self._log
        assert event_log is not None
        wall_s = self._clock.wall_s()
        # Queue the event on the loop's thread, so that it is not lost if the wait below times out.
        making = self._loop.submit(lambda: event_log.note([session.make(event, wall_s, **fields)]))
        self._clock.result(making, PATIENCE_S)

    def _flush(self) -> None:
        if self._log is not None:
            self._log.flush()
