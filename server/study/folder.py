"""Studies on disk: plans, sessions' event logs, and the models that participants taught."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from robot.errors import ConfigurationError, NotFoundError, RecordingError
from robot.store.folder import Storage, check_name, is_text, write_whole
from robot.study.archive import check_begun, pack
from robot.study.events import StudyEvent, read_events
from robot.study.plan import CODE, StudyPlan, parse_plan
from robot.study.session import SessionStep, follow_log

_PLAN, _ACTIVE = "plan.toml", "active.json"
_LONGEST_NAME = 40
LARGEST_PLAN = 100_000
"""Bytes of a plan; and of what reads it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionSummary:
    """What a list shows of one session; `fault` where its log cannot be read."""

    participant: str
    slot: int = -1
    step: str = ""
    position: int = 0
    of: int = 0
    began_s: float = 0.0
    is_begun: bool = False
    fault: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionModel:
    """The model of the session that is driven just now, and what was in use before it."""

    study: str
    participant: str
    position: int
    own: str
    before: str | None
    learner_before: str
    moves_before: tuple[str, ...]


class StudyFolder:
    """Everything below `studies/` in the data folder."""

    def __init__(self, storage: Storage) -> None:
        self._storage = storage
        self.root = storage.root / "studies"
        self._seen: dict[Path, tuple[tuple[int, str], SessionSummary]] = {}

    # Studies ----------------------------------------------------------------------------------

    def names(self) -> list[str]:
        """List the studies' names, sorted."""
        try:
            entries = sorted(self.root.iterdir())
        except OSError:
            return []
        return [e.name for e in entries if is_text(e.name) and (e / _PLAN).is_file()]

    def create(self, name: str, plan_text: str) -> str:
        """Keep a plan under a name; return the name in the form in which it is kept.

        Raises:
            ConfigurationError: If the name is taken or cannot be one, or the plan is none.
        """
        name = check_name(name)
        if len(name) > _LONGEST_NAME:
            raise ConfigurationError(f"a study's name has at most {_LONGEST_NAME} characters")
        if name.casefold() in {other.casefold() for other in self.names()}:
            raise ConfigurationError(f"there is already a study {name!r}; choose another name")
        if len(plan_text.encode()) > LARGEST_PLAN:
            raise ConfigurationError(f"the plan is larger than {LARGEST_PLAN} bytes; shorten it")
        parse_plan(plan_text)
        write_whole(self.root / name / _PLAN, plan_text.encode())
        return name

    def plan_text(self, name: str) -> str:
        """Return a study's plan as it was written.

        Raises:
            NotFoundError: If there is no such study.
            RecordingError: If it cannot be read.
        """
        if name not in self.names():
            raise NotFoundError(f"unknown study {name[:80]!r}")
        try:
            return (self.root / name / _PLAN).read_text("utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise RecordingError(f"the plan of {name!r} cannot be read: {error}") from error

    def plan(self, name: str) -> StudyPlan:
        """Return a study's plan.

        Raises:
            NotFoundError, RecordingError, ConfigurationError: If there is none that can be read.
        """
        return parse_plan(self.plan_text(name), f"{name}/{_PLAN}")

    def zip(self, name: str) -> bytes:
        """Return everything of a study as one zip, but the models."""
        text = self.plan_text(name)
        return pack(text, {code: self._read(name, code) for code in self.codes(name)})

    # Sessions ---------------------------------------------------------------------------------

    def codes(self, name: str) -> list[str]:
        """List the participants who have a session, sorted."""
        stems = (path.stem for path in (self.root / name).glob("*.csv"))
        return sorted(stem for stem in stems if CODE.fullmatch(stem))

    def log_path(self, name: str, code: str) -> Path:
        """Return where a session's event log is.

        Raises:
            ConfigurationError: If that is no participant's code.
        """
        if not CODE.fullmatch(code):
            raise ConfigurationError(
                f"{code[:40]!r} is no code: one to three capital letters and one to four digits, "
                "such as P07, and never a name"
            )
        return self.root / name / f"{code}.csv"

    def model_path(self, name: str, code: str, position: int) -> Path:
        """Return where what a participant taught is kept."""
        return self.root / name / "models" / f"{code}-{position}.npz"

    def events(self, name: str, code: str) -> list[StudyEvent]:
        """Read a session's event log; [] if there is none.

        Raises:
            RecordingError: If it cannot be read.
        """
        if code not in self.codes(name):
            return []
        return check_begun(code, read_events(self._read(name, code), f"{name}/{code}.csv"))

    def _read(self, name: str, code: str) -> bytes:
        try:
            return self.log_path(name, code).read_bytes()
        except OSError as error:
            raise RecordingError(f"{name}/{code}.csv cannot be read: {error}") from error

    def summaries(self, name: str) -> list[SessionSummary]:
        """Summarize each session; one that cannot be read says why."""
        text = self.plan_text(name)
        mark = fingerprint(text)
        plan = parse_plan(text, f"{name}/{_PLAN}")
        return [self._summary(name, plan, mark, code) for code in self.codes(name)]

    def _summary(self, name: str, plan: StudyPlan, mark: str, code: str) -> SessionSummary:
        path = self.log_path(name, code)
        try:
            size = path.stat().st_size
        except OSError:
            size = -1
        known = self._seen.get(path)
        if known is None or known[0] != (size, mark):
            known = ((size, mark), self._summarize(name, plan, code))
            self._seen[path] = known
        return known[1]

    def _summarize(self, name: str, plan: StudyPlan, code: str) -> SessionSummary:
        try:
            events = self.events(name, code)
            session = follow_log(plan, code, events)
        except (RecordingError, ConfigurationError, KeyError, IndexError) as error:
            return SessionSummary(participant=code, fault=str(error))
        return SessionSummary(
            participant=code,
            slot=session.slot,
            step=session.step.value,
            position=min(session.position + 1, len(session.order)),
            of=len(session.order),
            began_s=events[0].wall_s,
            is_begun=session.step is not SessionStep.DONE,
        )

    def withdraw(self, name: str, code: str) -> str:
        """Move all of a participant to the trash, models too; return the trash's key.

        Raises:
            NotFoundError: If there is no such session.
        """
        if name not in self.names() or code not in self.codes(name):
            raise NotFoundError(f"there is no session of {code[:40]!r} in {name[:80]!r}")
        models = (self.root / name / "models").glob(f"{code}-*.npz")
        return self._storage.discard(self.log_path(name, code), *models)

    # The session that is driven ---------------------------------------------------------------

    @property
    def active(self) -> SessionModel | None:
        """The session's model that is in use, also after a power cut."""
        try:
            plain = json.loads((self.root / _ACTIVE).read_bytes())
            plain["moves_before"] = tuple(plain["moves_before"])
            return SessionModel(**plain)
        except (OSError, ValueError, KeyError, TypeError):
            return None

    @active.setter
    def active(self, model: SessionModel | None) -> None:
        if model is None:
            (self.root / _ACTIVE).unlink(missing_ok=True)
            return
        plain: Mapping[str, Any] = asdict(model)
        write_whole(self.root / _ACTIVE, json.dumps(plain).encode())


def fingerprint(plan_text: str) -> str:
    """Return a mark of a plan: another for another text."""
    return hashlib.sha256(plan_text.encode()).hexdigest()[:16]
