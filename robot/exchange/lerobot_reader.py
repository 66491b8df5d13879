"""Reads LeRobot datasets of versions 2.0, 2.1 and 3.0, even damaged ones, one episode at a time.

Version 2 has one table and one film per episode. In version 3, several episodes share a table and a
film, and another table lists the rows and the seconds of each episode. Source: lerobot,
datasets/utils.py, and its documents lerobot-dataset-v3.mdx and porting_datasets_v3.mdx.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from robot.devices.raw_value import RawValue, must_be, number, read, text, whole
from robot.devkit.pictures import Picture, read_picture
from robot.errors import ConfigurationError, RecordingError, told_as
from robot.exchange.drive import Drive, FrameEvent, ImportReport, drive_of
from robot.exchange.files import parse, read_picture_file, read_text
from robot.exchange.film import FilmReader
from robot.exchange.lerobot_tables import DEGREES, PILOT, ROBOT, read_table
from robot.exchange.reading import Reading
from robot.exchange.steering import (
    ANGLES,
    FULL_MPS,
    FULL_TURN_DEG_S,
    FULL_TURN_RAD_S,
    THROTTLES,
    LabelAndPoints,
    at_velocity,
    check_unit,
    point_or_none,
    read_meant,
    read_number,
    read_point,
)
from robot.moves import CLASSIC
from robot.types import DEFAULT_MOVES, Action

_INTERVENTIONS = ("intervention", "complementary_info.is_intervention")
"""Names of the column that marks interventions. If a dataset has a column for interventions, only
the frames with an intervention are examples. If both columns exist, `pilot` counts."""
_FIELD = re.compile(r"\{(\w+)(?::0(\d)d)?\}")
_MOST_S = 1e7
Record = dict[str, Any]
Pair = tuple[float, float]
_VELOCITIES: dict[tuple[str, str], Pair] = {
    ("linear_velocity", "angular_velocity"): (1.0, 1.0),
    ("x.vel", "theta.vel"): (FULL_MPS, FULL_TURN_DEG_S),
    ("linear.x", "angular.z"): (FULL_MPS, FULL_TURN_RAD_S),
}
"""Each pair of names denotes an action's forward speed and its turning speed to the left. The
numbers are the values at full speed. The EarthRover Mini (first pair) uses shares of full speed,
LeKiwi (second pair) metres and degrees per second, and ROS (third pair) metres and radians."""


class _Info(RawValue):
    """The fields of meta/info.json that the import uses."""

    codebase_version: str = text()
    fps: float = number(above=0, most=1000)
    features: dict[str, dict[str, Any]] = must_be("an object of features")
    video_path: str | None = text(None)
    robot_type: str | None = text(None)
    chunks_size: int = whole(1000, least=1, most=10**9)


class LerobotDataset:
    """An opened dataset; raises RecordingError if its description is missing or invalid."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        with told_as(RecordingError, f"{folder}/meta/info.json is damaged", ConfigurationError):
            self._info = read(_Info, parse(read_text(folder / "meta/info.json")))
        self._is_v3 = self._info.codebase_version.startswith("v3")
        if not self._info.codebase_version.startswith(("v2.", "v3.")):
            version = self._info.codebase_version
            raise RecordingError(f"{folder} is a LeRobot dataset {version[:20]}, not v2 or v3")

    def episodes(self) -> list[int]:
        """Return the numbers of the episodes, from the table of episodes and from the data."""
        return sorted(n for n in {*self._rows, *self._files} if n >= 0)

    def why_empty(self) -> str:
        """Return the reason why the dataset has no episode, for an error message that begins with
        the dataset's path."""
        if any(self.folder.glob("data/*/*.parquet")) or any(self.folder.glob("images/*/*")):
            return (
                "is a LeRobot dataset that was never finalized: its tables are incomplete and "
                "cannot be read; record again, and call finalize() on the dataset"
            )
        return "is a LeRobot dataset without an episode"

    @cached_property
    def _rows(self) -> dict[int, Record]:
        """The readable rows of the table of episodes, by the number of the episode."""
        rows: list[Any] = []
        if self._is_v3:
            for path in sorted(self.folder.glob("meta/episodes/*/*.parquet")):
                with contextlib.suppress(RecordingError):
                    rows += read_table(path)
        elif (path := self.folder / "meta/episodes.jsonl").is_file():
            rows += map(parse, read_text(path).split("\n"))
        found = ((row.get("episode_index"), row) for row in rows if isinstance(row, dict))
        return {n: row for n, row in found if isinstance(n, int)}

    @cached_property
    def _files(self) -> dict[int, Path]:
        """The file that holds the frames of each episode, found by its name or its content."""
        files: dict[int, Path] = {}
        for path in sorted(self.folder.glob("data/*/*.parquet")):
            if of_name := re.fullmatch(r"episode_(\d{1,9})", path.stem):
                files[int(of_name[1])] = path
                continue
            with contextlib.suppress(RecordingError):
                rows = read_table(path, ["episode_index"])
                found = [row.get("episode_index") for row in rows]
                files |= {n: path for n in found if isinstance(n, int)}
        return files

    def read(self, episode: int, reading: Reading, report: ImportReport) -> Drive:
        """Read the labels and times of one episode. Its pictures are read later, when the drive is
        written.

        Raises RecordingError if no frame of the episode can be used.
        """
        if episode not in self._files:
            raise RecordingError(f"the data of episode {episode} is missing")
        camera = self._camera(report)
        is_film = self._info.features[camera].get("dtype") == "video"
        wanted = [PILOT, DEGREES, "action", "timestamp", "frame_index", *_INTERVENTIONS]
        wanted += [] if is_film else [camera]
        records = read_table(self._files[episode], wanted, episode)
        picture_of = (
            self._film(camera, episode) if is_film else partial(_stored, self.folder, camera)
        )
        meant = self._label_reader(reading, report)
        angle = self._place_of(*ANGLES) if PILOT not in self._info.features else None
        if angle is not None:
            actions = (_flat(record.get("action")) for record in records)
            named = _names(self._info.features["action"].get("names"))[angle]
            check_unit((v[angle] for v in actions if angle < len(v)), named, reading)
        said_by = next((n for n in (PILOT, *_INTERVENTIONS) if n in self._info.features), None)
        if said_by in _INTERVENTIONS:
            report.remark(f"only the frames that {said_by} marks as the pilot's are examples")

        def read_row(place: str, record: Record) -> FrameEvent:
            is_pilots = said_by is None or _flat(record.get(said_by))[:1] not in ([-1], [0], [])
            if said_by == PILOT:
                is_pilots = _flat(record.get(PILOT)) != [-1]
            label, point, does = meant(record) if is_pilots else (None, None, None)
            steered = _flat(record.get("action"))
            return FrameEvent(
                place=place,
                t_s=self._seconds(record),
                label=label,
                point=point,
                does=does,
                picture=picture_of(record),
                steering=steered[angle] if angle is not None and angle < len(steered) else None,
                is_intervention=any(_flat(record.get(n))[:1] == [1] for n in _INTERVENTIONS),
                is_others=not is_pilots,
            )

        numbered = ((f"episode {episode} frame {n}", r) for n, r in enumerate(records))
        return drive_of(
            numbered,
            read_row,
            f"episode {episode} of {self.folder} has no frames",
            name=f"{self.folder.name} {episode}",
            source=f"LeRobot {self._info.codebase_version}",
            report=report,
        )

    def _camera(self, report: ImportReport) -> str:
        """Return the camera whose name says that it looks ahead, else the first camera."""
        features = self._info.features
        cameras = [
            name
            for name, of in features.items()
            if of.get("dtype") in ("video", "image") and not _is_depth(of)
        ]
        if not cameras:
            raise RecordingError(f"{self.folder} has no colour camera")
        best = next((n for n in cameras if "front" in n), cameras[0])
        if len(cameras) > 1:
            report.remark(f"the dataset has {len(cameras)} cameras; this camera is used: {best}")
        return best

    def _film(self, camera: str, episode: int) -> Callable[[Record], Callable[[], Picture]]:
        """Return a function that finds a frame's picture in the film."""
        numbers: Record = {
            "video_key": camera,
            "episode_index": episode,
            "episode_chunk": episode // self._info.chunks_size,
        }
        begin: Any = 0.0
        if self._is_v3:
            row, key = self._rows.get(episode, {}), f"videos/{camera}"
            numbers |= {n: row.get(f"{key}/{n}") for n in ("chunk_index", "file_index")}
            begin = row.get(f"{key}/from_timestamp")
        if isinstance(begin, bool) or not isinstance(begin, int | float):
            raise RecordingError(
                f"meta/episodes has no start time for the film of episode {episode}"
            )

        def put(found: re.Match[str]) -> str:
            value = numbers.get(found[1], "")
            return f"{value:0{found[2] or 1}d}" if isinstance(value, int) else str(value)

        path = self.folder / _FIELD.sub(put, self._info.video_path or "")
        own = self.folder.resolve()
        roots = own, own.parent.parent / "blobs"  # Hugging Face's cache links to files in "blobs"
        if not path.is_file() or not any(map(path.resolve().is_relative_to, roots)):
            raise RecordingError(f"the film of episode {episode} is missing or outside the folder")
        film = FilmReader(path, self._info.fps)

        def picture_of(record: Record) -> Callable[[], Picture]:
            at_s = self._seconds(record)
            if at_s is None:
                raise ValueError("the row has no time, so its picture cannot be found")
            return partial(film.at, begin + at_s)

        return picture_of

    def _seconds(self, record: Record) -> float | None:
        """Return a frame's time. If the time is missing, compute it from the frame's number."""
        [stamp_s] = _flat(record.get("timestamp"))[:1] or [None]
        [index] = _flat(record.get("frame_index"))[:1] or [None]
        if isinstance(stamp_s, float) and 0 <= stamp_s < _MOST_S:
            return stamp_s
        return index / self._info.fps if isinstance(index, int) and 0 <= index < _MOST_S else None

    def _place_of(self, *names: str) -> int | None:
        """Return the index of the action's element that has one of these names; None if there is
        none. An action is a vector with named elements."""
        there = _names(self._info.features.get("action", {}).get("names"))
        return next((i for i, name in enumerate(there) if _bare(name) in names), None)

    def _label_reader(
        self, reading: Reading, report: ImportReport
    ) -> Callable[[Record], LabelAndPoints]:
        """Return a function that computes a frame's label, by the names of the action's
        elements."""
        features = self._info.features
        names = _names(features.get("action", {}).get("names"))
        angle, throttle = self._place_of(*ANGLES), self._place_of(*THROTTLES)

        def steered(record: Record) -> list[Any]:
            values = _action(record, len(names))
            return [values[i] for i in (angle, throttle) if i is not None]

        own = _info_of(features.get(PILOT, {})).get("moves")
        if isinstance(own, list) and all(isinstance(move, str) for move in own):

            def own_meant(record: Record) -> LabelAndPoints:
                label = Action(own[_one(record.get(PILOT), range(len(own)))])
                if _flat(record.get(DEGREES))[:1] == [True]:
                    return label, read_point(steered(record)), None
                return label, None, point_or_none(steered(record))

            return own_meant
        if angle is not None:
            moves = tuple(CLASSIC) if self._info.robot_type == ROBOT else DEFAULT_MOVES
            return lambda record: (*read_meant(steered(record), reading, moves=moves), None)
        for pair, full in _VELOCITIES.items():
            if set(pair) <= set(names):
                at = [names.index(name) for name in pair]

                def moved(record: Record, at: list[int] = at, full: Pair = full) -> LabelAndPoints:
                    values = _action(record, len(names))
                    shares = [
                        read_number(values[i], names[i]) / of
                        for i, of in zip(at, full, strict=True)
                    ]
                    return (*at_velocity(shares[0], shares[1], reading), None)

                return moved
        hot = [reading.move(_bare(name)) for name in names]
        if hot and all(hot):
            return lambda record: (_one_hot(record, hot), None, None)
        told = ", ".join(map(_bare, names))[:80] or "without names"
        report.skip("action", f"it has neither steering nor moves ({told}); there are no examples")
        return lambda record: (None, None, None)


def _is_depth(feature: Record) -> bool:
    """True for a depth camera. Version 0.6 of lerobot renamed the field that marks depth cameras;
    the description of the film may contain the old or the new name."""
    said = [feature, *(feature.get(name) for name in ("info", "video_info"))]
    names = "is_depth_map", "video.is_depth_map"
    return any(of.get(name) is True for of in said if isinstance(of, dict) for name in names)


def _info_of(feature: Record) -> Record:
    info = feature.get("info") or feature.get("video_info")
    return info if isinstance(info, dict) else {}


def _names(given: object) -> list[str]:
    """Return the names of a vector's elements, in lower case.

    Most datasets have a list of names. Some have a dictionary that maps each name to its index, or
    a dictionary with one entry whose value is the list.
    """
    if isinstance(given, dict):
        places = [place for place in given.values() if type(place) is int]
        if given and sorted(places) == list(range(len(given))):
            given = sorted(given, key=given.__getitem__)
        elif len(given) == 1:
            given = next(iter(given.values()))
    names = given if isinstance(given, list) else []
    return [str(name).lower() for name in names]


def _bare(name: str) -> str:
    return name.removesuffix(".pos").removesuffix(".vel")


def _flat(value: object) -> list[Any]:
    return value if isinstance(value, list) else [] if value is None else [value]


def _one(value: object, known: range) -> int:
    found = _flat(value)
    if len(found) != 1 or found[0] not in known:
        raise ValueError(f"{PILOT} is {str(value)[:40]!r}, not one of the moves")
    return int(found[0])


def _action(record: Record, count: int) -> list[Any]:
    values = _flat(record.get("action"))
    if len(values) != count:
        raise ValueError(f"the action has {len(values)} elements, not {count}")
    return values


def _one_hot(record: Record, moves: list[Action | None]) -> Action | None:
    values = _action(record, len(moves))
    if set(values) - {0.0, 1.0} or values.count(1.0) > 1:
        raise ValueError(f"the action {str(values)[:40]} may contain only zeros and a single 1")
    move = moves[values.index(1.0)] if 1.0 in values else None
    return None if move is Action.STOP else move


def _stored(folder: Path, camera: str, record: Record) -> Callable[[], Picture]:
    """Return a function that reads a picture from the table, or from a file named in the table."""
    stored = record.get(camera)
    if not isinstance(stored, dict):
        raise ValueError("the row has no picture")
    if isinstance(data := stored.get("bytes"), bytes):
        return partial(read_picture, data, "the picture")
    return partial(read_picture_file, folder, str(stored.get("path")))
