"""The tables of an open recording in memory, as arrays: about fifty bytes per picture."""

from __future__ import annotations

import json
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from math import isnan, nan
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from robot.errors import UNREADABLE, RecordingError, told_as
from robot.policy.events import (
    Edited,
    HistoryEvent,
    Taught,
    Undone,
    describe_event,
    read_event,
    read_point,
)
from robot.recordings.images import FrameEntry
from robot.recordings.messages import Fields, Topic
from robot.recordings.reader import Block, MessageChannel
from robot.types import Action, Example, Point

_FRAME = np.dtype(
    [
        ("id", "<u4"),
        ("log_ns", "<i8"),
        ("chunk", "<i8"),
        ("start", "<u4"),
        ("stop", "<u4"),
        ("channel", "<u2"),
    ]
)
_NOT_PLAIN = 255
"""Value in the column of labels for an event that the columns cannot describe, such as an undo. An
event with this value is stored separately."""
_NO_VECTOR, _NO_POINT = np.zeros(0), Point(nan, nan)


class FrameTable(Mapping[int, FrameEntry]):
    """The pictures of a recording by their ids, in ascending order. If an id occurs twice, its last
    picture counts."""

    def __init__(self, origin_ns: int = 0) -> None:
        self.origin_ns = origin_ns
        self._rows = bytearray()
        self._channels: list[MessageChannel] = []
        self._table: NDArray[np.void] | None = None
        self._ids = np.zeros(0, np.uint32)
        self.is_ordered = True
        """True if the file contains each picture once, in ascending order of the ids."""

    def add(self, block: Block) -> None:
        rows = block.of(Topic.CAMERA)
        if not len(rows):
            return
        table = np.zeros(len(rows), _FRAME)
        for name, source in (("id", "sequence"), *((n, n) for n in ("log_ns", "start", "stop"))):
            table[name] = rows[source]
        table["chunk"] = block.offset
        for number in _different(rows["channel"]):
            channel = block.channels[number]
            if channel not in self._channels:
                self._channels.append(channel)
            table["channel"][rows["channel"] == number] = self._channels.index(channel)
        self._table = None  # the rows cannot be extended while numpy's view of them exists
        self._rows += table.tobytes()

    def dump(self) -> tuple[bytes, list[MessageChannel]]:
        """Return the rows of all pictures in the order of the file, and the channels that the rows
        refer to."""
        return bytes(self._rows), self._channels

    def load(self, data: bytes, channels: Sequence[MessageChannel], base: int = 0) -> None:
        """Add the rows that a `dump` returned; the file of these rows begins at the offset `base`.
        Raises one of `UNREADABLE` if the rows are invalid."""
        table = np.frombuffer(data, _FRAME).copy()
        self._channels += [channel for channel in channels if channel not in self._channels]
        numbers = np.array([self._channels.index(channel) for channel in channels], "<u2")
        if len(table):
            if int(table["channel"].max()) >= len(numbers):
                raise RecordingError("a picture belongs to an unknown channel")
            table["channel"] = numbers[table["channel"]]
            if int(table["chunk"].min()) < 0:
                raise RecordingError("a picture lies before the beginning of the file")
            table["chunk"] += base
        self._table = None
        self._rows += table.tobytes()

    @property
    def table(self) -> NDArray[np.void]:
        if self._table is None:
            found = np.frombuffer(self._rows, _FRAME)
            ids = found["id"]
            self.is_ordered = bool((ids[1:] > ids[:-1]).all())
            if not self.is_ordered:
                _, last = np.unique(ids[::-1], return_index=True)
                found = found[len(found) - 1 - last]
                self._rows = bytearray(found.tobytes())
            self._table = found
        return self._table

    @property
    def ids(self) -> NDArray[np.uint32]:
        table = self.table
        if len(self._ids) != len(table):
            self._ids = np.ascontiguousarray(table["id"])
        return self._ids

    @property
    def captured_s(self) -> NDArray[np.float64]:
        """The time at which each picture was taken, in seconds of the run's clock."""
        return self.captured_s_of(slice(None))

    def captured_s_of(self, ranks: NDArray[np.int64] | slice) -> NDArray[np.float64]:
        """Return the times at which the pictures with these ranks were taken."""
        times_s: NDArray[np.float64] = (self.table["log_ns"][ranks] - self.origin_ns) / 1e9
        return times_s

    def at(self, index: int) -> FrameEntry:
        """Return the entry of the picture with this rank."""
        frame_id, log_ns, chunk, start, stop, number = self.table[index].item()
        channel = self._channels[number]
        return FrameEntry(
            frame_id=frame_id,
            captured_s=(log_ns - self.origin_ns) / 1e9,
            schema=channel.schema.name,
            size=_size(channel),
            place=(chunk, start, stop),
        )

    @property
    def sizes(self) -> set[tuple[int, int]]:
        """The sizes of the pictures (width and height in pixels), as the channels state them."""
        return {_size(self._channels[n]) for n in _different(self.table["channel"])}

    def rank(self, frame_id: int) -> int | None:
        """Return the index of the picture in the recording, from 0; None if it is missing."""
        ids = self.ids
        if not 0 <= frame_id < 2**32:
            return None
        # Use np.uint32: numpy would convert all ids to compare them with a Python int.
        index = int(ids.searchsorted(np.uint32(frame_id)))
        return index if index < len(ids) and ids[index] == frame_id else None

    def __getitem__(self, frame_id: int) -> FrameEntry:
        index = self.rank(frame_id)
        if index is None:
            raise KeyError(frame_id)
        return self.at(index)

    def __contains__(self, frame_id: object) -> bool:
        return isinstance(frame_id, int) and self.rank(frame_id) is not None

    def __iter__(self) -> Iterator[int]:
        return iter(self.ids.tolist())

    def __len__(self) -> int:
        return len(self.table)


def _different(numbers: NDArray[np.unsignedinteger]) -> list[int]:
    """Return the numbers without duplicates, in ascending order. `np.unique` would import a large
    module."""
    return np.flatnonzero(np.bincount(numbers)).tolist()


@cache
def _size(channel: MessageChannel) -> tuple[int, int]:
    size = dict(channel.metadata)
    with told_as(RecordingError, "the size of the pictures is damaged", ValueError):
        return int(size.get("width", "0")), int(size.get("height", "0"))


class LessonTable(Sequence[tuple[float, HistoryEvent]]):
    """The teaching and undo events with their times, in the order of the file."""

    def __init__(self) -> None:
        self._now_s = array("d")
        self._frame = array("q")
        self._label = array("B")
        self._is_intervention = array("B")
        self._at_s = array("d")
        # Few examples have steering and throttle, so these two columns end at the last example that
        # has them.
        self._steering, self._throttle = array("d"), array("d")
        self._labels: list[Action] = []
        self._others: dict[int, HistoryEvent] = {}

    def add(self, times_s: Sequence[float], texts: Sequence[bytes]) -> None:
        """Add messages. Raises one of `UNREADABLE` if a message is damaged."""
        try:
            plain: list[Any] = json.loads(b"[" + b",".join(texts) + b"]")
            is_whole = len(plain) == len(texts)
        except UNREADABLE:
            is_whole = False
        if is_whole and self._add_plain(times_s, plain):
            return
        for now_s, text in zip(times_s, texts, strict=True):
            self._add(now_s, json.loads(text))

    def _add_plain(self, times_s: Sequence[float], plain: Sequence[Fields]) -> bool:
        """Add all events at once if the columns can hold each of them. Otherwise, or if only some
        of the events contain steering and throttle, add no event and return False."""
        try:
            frames = [fields["frame"] for fields in plain]
            labels = [fields["label"] for fields in plain]
            interventions = [fields["intervention"] for fields in plain]
            at_s = [fields["at_s"] for fields in plain]
            steering = [fields["steering"] for fields in plain if "steering" in fields]
            throttle = [fields["throttle"] for fields in plain if "throttle" in fields]
            is_plain = (
                all(fields["event"] == "taught" and not fields["x"] for fields in plain)
                and len(steering) == len(throttle)
                and len(steering) in (0, len(plain))
                and {type(share) for share in (*steering, *throttle)} <= {float, int}
                and all(-1.0 <= share <= 1.0 for share in (*steering, *throttle))
                and {type(frame) for frame in frames} <= {int}
                and {type(time_s) for time_s in at_s} <= {float, int}
                and {type(is_one) for is_one in interventions} <= {bool}
                and all(0 <= frame < 2**32 for frame in frames)
            )
            numbers = {label: self._number(label) for label in dict.fromkeys(labels)}
        except UNREADABLE:
            return False
        if not is_plain or _NOT_PLAIN in numbers.values():
            return False
        if steering:
            self._fill_points()
            self._steering.extend(steering)
            self._throttle.extend(throttle)
        self._frame.extend(frames)
        self._now_s.extend(times_s)
        self._label.extend(map(numbers.__getitem__, labels))
        self._is_intervention.extend(interventions)
        self._at_s.extend(at_s)
        return True

    def _add(self, now_s: float, fields: Fields) -> None:
        try:
            is_plain = fields["event"] == "taught" and not fields.get("x")
        except UNREADABLE:
            is_plain = False
        if is_plain:
            with told_as(RecordingError, "an example is damaged", *UNREADABLE):
                label = self._number(fields["label"])
                frame_id, at_s = int(fields["frame"]), float(fields["at_s"])
                is_intervention = bool(fields["intervention"])
                point = read_point(fields) or _NO_POINT
        if not is_plain or label == _NOT_PLAIN:
            event = read_event(fields)
            frame_id = event.example.frame_id if isinstance(event, Taught) else -1
            label, is_intervention, at_s, point = _NOT_PLAIN, False, 0.0, _NO_POINT
            self._others[len(self._frame)] = event
        if point is not _NO_POINT:
            self._fill_points()
            self._steering.append(point.steering)
            self._throttle.append(point.throttle)
        self._frame.append(frame_id)
        self._now_s.append(now_s)
        self._label.append(label)
        self._is_intervention.append(is_intervention)
        self._at_s.append(at_s)

    def _fill_points(self) -> None:
        """Append NaN to the columns of steering and throttle until they are as long as the other
        columns."""
        for column in (self._steering, self._throttle):
            column.extend([nan] * (len(self) - len(column)))

    def dump(self) -> tuple[bytes, Fields]:
        """Return the events as columns, and the description of the columns."""
        others = {str(i): describe_event(event) for i, event in self._others.items()}
        about: Fields = {"count": len(self), "labels": self._labels, "others": others}
        self._fill_points()
        return b"".join(column.tobytes() for column in self._columns), about

    def load(self, data: bytes, about: Fields) -> None:
        """Add the events of a `dump`; raises one of `UNREADABLE` if the events are invalid."""
        count, before = int(about["count"]), len(self)
        sizes = [count * column.itemsize for column in self._columns]
        if sum(sizes) != len(data):
            raise RecordingError("the columns are longer or shorter than their header says")
        numbers = [self._number(label) for label in about["labels"]]
        if _NOT_PLAIN in numbers:
            raise RecordingError("there are too many labels")
        numbers += range(len(numbers), _NOT_PLAIN + 1)
        parts, at = [], 0
        for size in sizes:
            parts.append(data[at : at + size])
            at += size
        labels = np.frombuffer(parts[2], np.uint8)
        steering, throttle = (np.frombuffer(part, np.float64) for part in parts[5:])
        is_other = labels == _NOT_PLAIN
        if (
            int(labels[~is_other].max(initial=0)) >= max(len(about["labels"]), 1)
            or set(np.flatnonzero(is_other).tolist()) != set(map(int, about["others"]))
            or (np.abs(steering) > 1).any()
            or (np.abs(throttle) > 1).any()
        ):
            raise RecordingError("the columns contradict each other")
        parts[2] = np.array(numbers, np.uint8)[labels].tobytes()
        columns = self._columns
        if np.isnan(steering).all() and np.isnan(throttle).all():
            columns, parts = columns[:5], parts[:5]
        else:
            self._fill_points()
        for column, part in zip(columns, parts, strict=True):
            column.frombytes(part)
        for row, fields in about["others"].items():
            self._others[before + int(row)] = read_event(fields)

    @property
    def _columns(self) -> tuple[array[Any], ...]:
        return (
            self._now_s,
            self._frame,
            self._label,
            self._is_intervention,
            self._at_s,
            self._steering,
            self._throttle,
        )

    def _number(self, name: str) -> int:
        if name not in self._labels:
            if len(self._labels) == _NOT_PLAIN:
                return _NOT_PLAIN
            self._labels.append(Action(name))
        return self._labels.index(Action(name))

    @overload
    def __getitem__(self, index: int) -> tuple[float, HistoryEvent]: ...
    @overload
    def __getitem__(self, index: slice) -> list[tuple[float, HistoryEvent]]: ...
    def __getitem__(self, index: int | slice) -> Any:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        if index < 0:
            index += len(self)
        return self._now_s[index], self.event(index)

    def event(self, index: int) -> HistoryEvent:
        if self._label[index] == _NOT_PLAIN:
            return self._others[index]
        return Taught(example=self.example(index), x=_NO_VECTOR, at_s=self._at_s[index])

    def example(self, index: int) -> Example:
        """Return the example of a teaching event."""
        if self._label[index] == _NOT_PLAIN:
            event = self._others[index]
            assert isinstance(event, Taught)
            return event.example
        point = _NO_POINT
        if index < len(self._steering):
            point = Point(self._steering[index], self._throttle[index])
        return Example(
            frame_id=self._frame[index],
            label=self._labels[self._label[index]],
            is_intervention=bool(self._is_intervention[index]),
            point=None if isnan(point.steering) else point,
        )

    def label(self, index: int) -> Action:
        return (
            self._labels[self._label[index]]
            if self._label[index] != _NOT_PLAIN
            else self.example(index).label
        )

    def __len__(self) -> int:
        return len(self._frame)

    @property
    def times_s(self) -> Sequence[float]:
        return self._now_s

    @property
    def frames(self) -> NDArray[np.int64]:
        """For each event, the id of the frame that it teaches; -1 if it teaches none."""
        return np.array(self._frame, np.int64)

    def rows_of(self, kind: type[Undone] | type[Edited]) -> list[int]:
        """Return the indices of the events of one kind, in order."""
        return [index for index, event in self._others.items() if isinstance(event, kind)]


class Labels(Mapping[int, Example]):
    """Maps each picture to its last example that the pilot did not undo."""

    def __init__(self, lessons: LessonTable) -> None:
        self._lessons = lessons
        frames = lessons.frames
        alive = frames >= 0
        for row in lessons.rows_of(Undone):
            event = lessons.event(row)
            assert isinstance(event, Undone)
            alive[:row] &= ~np.isin(frames[:row], event.frame_ids)
        self._rows = np.flatnonzero(alive)
        self._ids = frames[self._rows]
        if (self._ids[1:] <= self._ids[:-1]).any():
            self._ids, last = np.unique(self._ids[::-1], return_index=True)
            self._rows = self._rows[::-1][last]

    def __len__(self) -> int:
        return len(self._ids)

    def __getitem__(self, frame_id: int) -> Example:
        index = int(np.searchsorted(self._ids, frame_id))
        if index == len(self._ids) or self._ids[index] != frame_id:
            raise KeyError(frame_id)
        return self._lessons.example(int(self._rows[index]))

    def __iter__(self) -> Iterator[int]:
        return iter(self._ids.tolist())

    def examples(self, ids: NDArray[np.integer]) -> list[Example | None]:
        """Return the example of each of the pictures with these ids; None if a picture has none."""
        if not len(self._ids):
            return [None] * len(ids)
        at = np.minimum(np.searchsorted(self._ids, ids), len(self._ids) - 1)
        rows = np.where(self._ids[at] == ids, self._rows[at], -1).tolist()
        return [None if row < 0 else self._lessons.example(row) for row in rows]

    @property
    def counts(self) -> Counter[Action]:
        """The number of pictures that have each label."""
        return Counter(map(self._lessons.label, self._rows.tolist()))


class Span:
    """The times of the first and last messages of a recording, in nanoseconds since 1970."""

    def __init__(self) -> None:
        self._ends: dict[str, tuple[int, int]] = {}

    def add(self, block: Block, topics: Iterable[str]) -> None:
        for topic in topics:
            rows = block.of(topic)
            if len(rows):
                first, last = int(rows["log_ns"][0]), int(rows["log_ns"][-1])
                self._ends[topic] = self._ends.get(topic, (first, last))[0], last

    @property
    def ends(self) -> dict[str, tuple[int, int]]:
        """The times of the first and the last message of each topic."""
        return self._ends

    def load(self, ends: Mapping[str, Sequence[int]]) -> None:
        """Add the times of the recording's next file, as `ends` returned them for that file."""
        for topic, (first, last) in ends.items():
            self._ends[topic] = self._ends.get(topic, (int(first), 0))[0], int(last)

    @property
    def ends_ns(self) -> list[int]:
        return [end for pair in self._ends.values() for end in pair]


def read_fields(texts: Sequence[bytes]) -> list[Fields]:
    """Read messages in JSON; raises RecordingError if a message is not an object."""
    found = json.loads(b"[" + b",".join(texts) + b"]")
    if len(found) != len(texts) or not all(isinstance(fields, dict) for fields in found):
        raise RecordingError("a message has an unknown form")
    return found  # type: ignore[no-any-return]
