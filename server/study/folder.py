"""Studies on disk: their plans, event logs, and the models that participants have taught."""

from __future__ import annotations

import contextlib
import hashlib
import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from robot.devices.raw_value import RawValue, must_be, read, text, whole
from robot.errors import ConfigurationError, NotFoundError, RecordingError, RobotError, told_as
from robot.store.folder import Storage, check_name, fold, paths_in, write_whole
from robot.study.archive import pack
from robot.study.events import StudyEvent, check_begun, read_events, recordings_in
from robot.study.plan import CODE, MOST_CONDITIONS, StudyPlan, parse_plan
from robot.study.rows import condition_logs, outcome, refuse_same_columns
from robot.study.session import follow_log
from robot.types import Action
from server.study.erasing import erase

_PLAN, _ACTIVE = "plan.toml", "active.json"
LONGEST_NAME = 40
_PLANS, _SESSIONS = 16, 2**14
"""Maximum number of parsed plans, and maximum number of session summaries, in the caches."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionSummary:
    """One session in a list; `fault` says why its log cannot be read, else it is empty."""

    participant: str
    slot: int = -1
    order: tuple[str, ...] = ()
    step: str = ""
    position: int = 0
    of: int = 0
    began_at_s: float = 0.0
    fault: str = ""


class SessionModel(RawValue):
    """The model of the session that is being driven, and the model to which the robot returns."""

    study: str = text()
    participant: str = text()
    position: int = whole(least=1, most=MOST_CONDITIONS)
    own: str = text()
    before: str | None = text(None)
    learner_before: str = text()
    moves_before: list[str] = must_be("a list of moves")


class StudyFolder:
    """Everything below `studies/` in the data folder."""

    def __init__(self, storage: Storage) -> None:
        self._storage = storage
        self.root = storage.root / "studies"
        self._parse = lru_cache(_PLANS)(parse_plan)
        self._summary = lru_cache(_SESSIONS)(self._summarize)

    # Studies ----------------------------------------------------------------------------------

    def names(self) -> list[str]:
        return [path.name for path in paths_in(self.root) if (path / _PLAN).is_file()]

    def create(self, name: str, plan_text: str) -> str:
        """Save a plan under a name; return the name as it was saved.

        Raises:
            ConfigurationError: If the name is taken or invalid, or the plan is invalid.
        """
        name = check_name(name)
        if len(name) > LONGEST_NAME:
            raise ConfigurationError(f"a study's name may have at most {LONGEST_NAME} characters")
        if fold(name) in {fold(other) for other in self.names()}:
            raise ConfigurationError(f"there is already a study {name!r}; choose another name")
        refuse_same_columns(parse_plan(plan_text))
        write_whole(self.root / name / _PLAN, plan_text.encode())
        return name

    def plan_text(self, name: str) -> str:
        """Return a study's plan as it was written; raises NotFoundError or RecordingError."""
        if name not in self.names():
            raise NotFoundError(f"unknown study {name[:80]!r}")
        with told_as(RecordingError, f"the plan of {name!r} cannot be read", OSError, ValueError):
            return (self.root / name / _PLAN).read_text("utf-8")

    def plan(self, name: str) -> StudyPlan:
        """Return a study's plan; raises RobotError if it cannot be read."""
        return self._parse(self.plan_text(name), f"{name}/{_PLAN}")

    def zip(self, name: str) -> bytes:
        text = self.plan_text(name)
        return pack(text, {code: self.log(name, code) for code in self.codes(name)})

    # Sessions ---------------------------------------------------------------------------------

    def codes(self, name: str) -> list[str]:
        """List the participants who have a session, sorted."""
        stems = (path.stem for path in (self.root / name).glob("*.csv"))
        return sorted(stem for stem in stems if CODE.fullmatch(stem))

    def log_path(self, name: str, code: str) -> Path:
        """Return the path of a session's event log; ConfigurationError if the code is invalid."""
        if not CODE.fullmatch(code):
            raise ConfigurationError(
                f"{code[:40]!r} is not a participant's code; use one to three capital letters and "
                "one to four digits, such as P07, and never a name"
            )
        return self.root / name / f"{code}.csv"

    def model_path(self, name: str, code: str, position: int) -> Path:
        """Return the path of the model that a participant has taught in one condition."""
        return self.root / name / "models" / f"{code}-{position}.npz"

    def events(self, name: str, code: str) -> list[StudyEvent]:
        """Read a session's event log; raises RecordingError if it is damaged.

        If there is no log, the session has not begun, and the list is empty.
        """
        if code not in self.codes(name):
            return []
        events = read_events(self.log(name, code), f"{name}/{code}.csv")
        check_begun(events, f"{name}/{code}.csv")
        return events

    def log(self, name: str, code: str) -> bytes:
        """Return the bytes of a session's event log; raises NotFoundError if there is none."""
        path = self.log_path(name, code)
        if name not in self.names() or not path.is_file():
            raise NotFoundError(f"there is no session of {code[:40]!r} in {name[:80]!r}")
        with told_as(RecordingError, f"{name}/{code}.csv cannot be read"):
            return path.read_bytes()

    def summaries(self, name: str) -> list[SessionSummary]:
        """Return a summary of each session; that of an unreadable session has a `fault`."""
        plan_text, found = self.plan_text(name), []
        for code in self.codes(name):
            with contextlib.suppress(FileNotFoundError):  # the participant has just withdrawn
                log = self.log_path(name, code).stat()
                state = log.st_size, log.st_mtime_ns
                found.append(self._summary(name, code, plan_text, *state))
        return found

    def free_slots(self, name: str, plan: StudyPlan) -> list[int]:
        """Return the slots of the plan that no participant has, in order."""
        return sorted(set(range(plan.participants)) - {s.slot for s in self.summaries(name)})

    def _summarize(self, name: str, code: str, plan_text: str, *_state: int) -> SessionSummary:
        plan = self._parse(plan_text, f"{name}/{_PLAN}")
        try:
            events = self.events(name, code)
            session = follow_log(plan, code, events)
        except RobotError as error:
            return SessionSummary(participant=code, fault=str(error))
        return SessionSummary(
            participant=code,
            slot=session.slot,
            order=session.order,
            step=session.step.value,
            position=min(session.position + 1, len(session.order)),
            of=len(session.order),
            began_at_s=events[0].wall_s,
        )

    def outcomes(self, name: str, code: str) -> list[dict[str, Any]]:
        """Return how similarly participant and robot drove, for each condition that was driven."""
        return [outcome(log) for log in condition_logs(self.plan(name), code, self.log(name, code))]

    def withdraw(self, name: str, code: str, recording: str | None) -> list[str]:
        """Permanently delete all data of a participant: the log, the models and the recordings,
        including those in the trash.

        Returns the deleted paths, relative to the data folder. Raises ConfigurationError if the
        current recording (`recording`) belongs to the participant.
        """
        recordings = recordings_in(self.log(name, code))
        if recording in recordings:
            raise ConfigurationError("this session is still being recorded; wait ten seconds")
        models = sorted((self.root / name / "models").glob(f"{code}-*.npz"))
        in_use = [model_name(name, code, n) for n in range(1, MOST_CONDITIONS + 1)]
        return erase(self._storage, [*recordings, *in_use], *models, self.log_path(name, code))

    # The current session --------------------------------------------------------------------------

    @property
    def active(self) -> SessionModel | None:
        """The session's model that the robot uses now. The value is stored in a file, so a power
        cut does not lose it."""
        try:
            model = read(SessionModel, json.loads((self.root / _ACTIVE).read_bytes()))
            list(map(Action, model.moves_before))  # raises ValueError for an unknown move
        except (OSError, ValueError, RecursionError):
            return None
        is_known = model.study in self.names() and CODE.fullmatch(model.participant)
        return model if is_known else None

    @active.setter
    def active(self, model: SessionModel | None) -> None:
        if model is None:
            (self.root / _ACTIVE).unlink(missing_ok=True)
            return
        write_whole(self.root / _ACTIVE, json.dumps(dict(model)).encode())


def model_name(study: str, participant: str, position: int) -> str:
    """Return the name that a session's model has while the robot uses it."""
    return f"{study} {participant} {position}"


def fingerprint(plan_text: str) -> str:
    """Return a hash of a plan's text."""
    return hashlib.sha256(plan_text.encode()).hexdigest()[:16]
