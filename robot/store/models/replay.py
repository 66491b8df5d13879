"""Crash recovery: the newest valid model, and the journal's changes after it."""

from __future__ import annotations

import json
import logging
import zlib
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from robot.errors import RobotError
from robot.policy.history import DriveBegun, Edited, HistoryEvent, LogEvent, Taught, replay
from robot.store.models.events import read_event
from robot.store.models.journal import HEAD, Part, list_parts
from robot.store.models.model import (
    MAX_BYTES,
    JournalPosition,
    Model,
    decode_model,
    same_nodes,
    take_model,
)
from robot.store.models.store import ModelStore
from robot.store.records import read_records

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recovered:
    """The recovered model.

    `name` is None if the model was never saved under one; `is_saved` is True if the newest version
    of that name holds it all.
    """

    model: Model
    name: str | None
    replayed: int
    is_saved: bool


@dataclass(slots=True)
class _Run:
    """The sound records of one start of the program."""

    boot: int
    run: str = ""
    events: dict[int, HistoryEvent] = field(default_factory=dict)
    checkpoints: dict[int, tuple[Model, str | None]] = field(default_factory=dict)
    drives: set[int] = field(default_factory=set)
    last: int = 0
    saved: int = -1


def recover(folder: Path, store: ModelStore) -> Recovered | None:
    """Return the last state of the last run; None if the journal does not hold it."""
    parts = list_parts(folder)
    boots = sorted({part.boot for part in parts}, reverse=True)
    for boot in boots:
        run = _read_run([part for part in parts if part.boot == boot])
        if run.checkpoints:
            break
    else:
        return None
    if run.saved >= run.last:
        return None
    if newest_boot(store) > run.boot:
        return None  # a later start saved it, and was over before it wrote to the journal
    try:
        return _rebuild(run, store)
    except RobotError as error:
        log.warning("the journal cannot be replayed: %s", error)
        return None


def _read_run(parts: list[Part]) -> _Run:
    run = _Run(boot=parts[0].boot)
    for part in parts:
        for path in part.paths:
            try:
                for record in read_records(path):
                    _take(run, record)
            except FileNotFoundError:
                continue
            except OSError as error:
                log.warning("the journal's file %s is skipped: %s", path.name, error)
    return run


def _take(run: _Run, record: bytes) -> None:
    """Take in one record; its twin in the other file changes nothing."""
    try:
        head, _, body = record.partition(HEAD)
        words: dict[str, Any] = json.loads(head)
        kind = words["kind"]
        if kind == "begin":
            run.run = str(words["run"])
            return
        change = int(words["change"])
        if kind == "drive":
            run.drives.add(change)
            return
        run.last = max(run.last, change)
        if kind == "saved":
            run.saved = max(run.saved, change)
        elif kind == "checkpoint" and change not in run.checkpoints:
            model = decode_model(_unpack(body))
            run.checkpoints[change] = (model, words["name"])
            for older in sorted(run.checkpoints)[:-2]:
                del run.checkpoints[older]
        elif kind == "event" and change not in run.events:
            run.events[change] = read_event(json.loads(_unpack(body)))
    except (RobotError, ValueError, KeyError, TypeError, zlib.error, RecursionError) as error:
        log.warning("a record of the journal is skipped: %s", error)


def _unpack(body: bytes) -> bytes:
    packed = zlib.decompressobj()
    data = packed.decompress(body, MAX_BYTES)
    if packed.unconsumed_tail:
        raise ValueError("it unpacks to too many bytes")
    return data


def _rebuild(run: _Run, store: ModelStore) -> Recovered | None:
    change = max(run.checkpoints)
    model, name = run.checkpoints[change]
    found = _newest_version(run, change, [store.current, name], store)
    is_file = found is not None
    if found is not None:
        change, model, name = found
    missing = [number for number in range(change + 1, run.last + 1) if number not in run.events]
    if missing:
        log.warning("%d records of the journal are missing", len(missing))
    numbers = [number for number in sorted(run.events) if number > change]
    if not numbers and (is_file or _is_saved(model, name, store)):
        return Recovered(model=model, name=name, replayed=0, is_saved=True)
    position = JournalPosition(run=run.run, boot=run.boot, change=run.last)
    recovered = _learn_on(model, run, numbers, position)
    return Recovered(
        model=recovered,
        name=name if name in store.names() else None,
        replayed=len(numbers),
        is_saved=False,
    )


def _newest_version(
    run: _Run, change: int, names: list[str | None], store: ModelStore
) -> tuple[int, Model, str] | None:
    """Return the newest sound version of this run that is not older than the checkpoint."""
    found = []
    for name in dict.fromkeys(name for name in names if name is not None):
        for model in store.sound_versions(name):
            position = model.summary.position
            if position is not None and position.run == run.run and position.change >= change:
                found.append((position.change, model, name))
                break
    return max(found, key=lambda one: one[0], default=None)


def _is_saved(model: Model, name: str | None, store: ModelStore) -> bool:
    """True if the newest sound version under this name holds the same."""
    for version in store.sound_versions(name) if name is not None else ():
        return same_nodes(version.state, model.state)
    return False


def newest_boot(store: ModelStore) -> int:
    """Return the number of the start that saved the model in use; 0 if none did."""
    name = store.current
    for model in store.sound_versions(name) if name is not None else ():
        return model.summary.position.boot if model.summary.position else 0
    return 0


def _learn_on(model: Model, run: _Run, numbers: list[int], position: JournalPosition) -> Model:
    """Return the model after these changes, as they were made."""
    policy, taught = model.to_policy(), Counter(model.summary.taught)
    policy.restore(model.state)  # it was taken in the middle of a drive
    events: list[LogEvent] = []
    for number in numbers:
        event = run.events[number]
        if number - 1 in run.drives:
            events.append(DriveBegun(at_s=0.0))
        if isinstance(event, Taught | Edited):
            events.append(event)
    taught.update(event.example.label for event in events if isinstance(event, Taught))

    def refuse(event: LogEvent, error: Exception) -> None:
        log.warning("a change could not be made again: %s", error)
        if isinstance(event, Taught):
            taught.subtract([event.example.label])

    replay(policy, events, refuse)
    summary = model.summary
    return take_model(
        policy, taught, saved_at_s=summary.saved_at_s, place=summary.place, position=position
    )
