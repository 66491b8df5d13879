"""Crash recovery from the newest valid model and the later changes in the journal."""

from __future__ import annotations

import json
import logging
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from operator import itemgetter
from pathlib import Path
from typing import Any

from robot.errors import UNREADABLE, RobotError
from robot.moves import Move
from robot.policy.changes import replay
from robot.policy.events import DriveBegun, Edited, HistoryEvent, LogEvent, Taught, read_event
from robot.store.models.journal_writer import HEAD, Part, list_parts
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

_LOADED = 1
"""Number of the first change in each run, which loads the model."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recovered:
    """The recovered model; `name` is None if the model was never saved under a name."""

    model: Model
    name: str | None
    replayed: int


@dataclass(slots=True)
class _Run:
    """The valid records of one start of the program."""

    boot: int
    run: str = ""
    events: dict[int, HistoryEvent] = field(default_factory=dict)
    checkpoint: tuple[int, Model, str | None] | None = None
    drives: set[int] = field(default_factory=set)
    last: int = 0
    saved: int = -1
    declared: Iterable[Move] = ()


def recover(folder: Path, store: ModelStore, declared: Iterable[Move] = ()) -> Recovered | None:
    """Return the state at the end of the last run. Return None if a saved model has this state, or
    if the journal does not contain the state. `declared` are the driver's moves, which the policy
    needs to replay the journal."""
    parts = list_parts(folder)
    boots = sorted({part.boot for part in parts}, reverse=True)
    runs = (_read_run(folder, [part for part in parts if part.boot == boot]) for boot in boots)
    run = next((run for run in runs if run.checkpoint is not None), None)
    if run is None or run.saved >= run.last:
        return None
    run.declared = declared
    if newest_boot(store) > run.boot:
        return None  # a later run saved the model, but ended before it wrote a journal
    try:
        return _rebuild(run, store)
    except RobotError as error:
        log.warning("the journal cannot be replayed: %s", error)
        return None


def _read_run(folder: Path, parts: list[Part]) -> _Run:
    run = _Run(boot=parts[0].boot)
    for part in parts:
        for path in part.files(folder):
            try:
                for record in read_records(path):
                    _take(run, record)
            except FileNotFoundError:
                continue
            except OSError as error:
                log.warning("the journal's file %s is skipped: %s", path.name, error)
    return run


def _take(run: _Run, record: bytes) -> None:
    """Add one record. A record that is in both files counts once."""
    try:
        head, _, body = record.partition(HEAD)
        words: dict[str, Any] = json.loads(head)
        kind = words["kind"]
        change = int(words["change"])
        if kind == "drive":
            run.drives.add(change)
            return
        run.last = max(run.last, change)
        if kind == "saved":
            run.saved = max(run.saved, change)
        elif kind == "checkpoint" and (run.checkpoint is None or run.checkpoint[0] < change):
            model = decode_model(_unpack(body))
            run.run = model.summary.position.run if model.summary.position else ""
            run.checkpoint = change, model, words["name"]
        elif kind == "event" and change not in run.events:
            run.events[change] = read_event(json.loads(_unpack(body)))
    except (*UNREADABLE, zlib.error) as error:
        log.warning("a record of the journal is skipped: %s", error)


def _unpack(body: bytes) -> bytes:
    packed = zlib.decompressobj()
    data = packed.decompress(body, MAX_BYTES)
    if packed.unconsumed_tail:
        raise ValueError("the record unpacks to too many bytes")
    return data


def _rebuild(run: _Run, store: ModelStore) -> Recovered | None:
    change, is_file, model, name = max(_bases(run, store), key=itemgetter(0, 1))
    missing = [number for number in range(change + 1, run.last + 1) if number not in run.events]
    if missing:
        log.warning("%d records of the journal are missing", len(missing))
    numbers = [number for number in sorted(run.events) if number > change]
    # If nothing was learned since the start, the journal only repeats the loaded model, and a model
    # that was saved later may be newer.
    if not numbers and (is_file or _is_saved(model, name, store, among_all=run.last <= _LOADED)):
        return None
    return Recovered(
        model=_learn_on(model, run, numbers),
        # If no model has this name, it was deleted, or it is the current model and was renamed.
        name=name if name is None or name in store.names() else store.current,
        replayed=len(numbers),
    )


def _bases(run: _Run, store: ModelStore) -> Iterator[tuple[int, bool, Model, str | None]]:
    """Yield the states from which a replay can begin: the checkpoint, and saved versions."""
    assert run.checkpoint is not None
    change, model, name = run.checkpoint
    yield change, False, model, name
    for saved in filter(None, (store.current, name)):
        for version in store.sound_versions(saved):
            position = version.summary.position
            if position is not None and position.run == run.run:
                yield position.change, True, version, saved
                break


def _is_saved(model: Model, name: str | None, store: ModelStore, *, among_all: bool) -> bool:
    """True if `model` equals this name's newest valid version; with `among_all`, any version."""
    versions = store.sound_versions(name) if name is not None else iter(())
    kept = versions if among_all else islice(versions, 1)
    return any(same_nodes(one.state, model.state) for one in kept)


def newest_boot(store: ModelStore) -> int:
    """Return the number of the run that saved the model in use; 0 if there is none."""
    name = store.current
    newest = next(store.sound_versions(name), None) if name is not None else None
    position = newest.summary.position if newest is not None else None
    return position.boot if position is not None else 0


def _learn_on(model: Model, run: _Run, numbers: list[int]) -> Model:
    """Repeat the changes with these numbers on the model; return the resulting model."""
    policy, taught = model.to_policy(), Counter(model.summary.taught)
    policy.kinds.describe(run.declared)
    policy.restore(model.state)  # `set_state` would forget the state of the drive
    events: list[LogEvent] = []
    for number in numbers:
        event = run.events[number]
        if number - 1 in run.drives:
            events.append(DriveBegun(at_s=0.0))
        if isinstance(event, Taught | Edited):
            events.append(event)
    taught.update(event.example.label for event in events if isinstance(event, Taught))

    def refuse(event: LogEvent, error: Exception) -> None:
        log.warning("a change in the journal could not be repeated: %s", error)
        if isinstance(event, Taught):
            taught.subtract([event.example.label])

    replay(policy, events, refuse)
    position = JournalPosition(run=run.run, boot=run.boot, change=run.last)
    return take_model(policy, taught, place=model.summary.place, position=position)
