"""Writes LeRobotDataset v3 without the lerobot package: parquet tables, and pictures as films.

The files of a dataset are:

    meta/info.json                                      features, counts, paths
    meta/stats.json                                     of all episodes together
    meta/tasks.parquet                                  task text (the index) and its number
    meta/episodes/chunk-000/file-000.parquet            one row per episode: lengths, files, stats
    data/chunk-000/file-000.parquet                     one row per frame
    videos/observation.images.front/chunk-000/file-NNN.mp4

LeRobot needs timestamps that are exactly frame_index / fps. Pictures are therefore resampled to one
rate, and a recording is split where pictures are missing for longer than a second. All pictures of
a dataset are scaled to the size of the first.

Source: lerobot, datasets/utils.py, dataset_writer.py and docs/source/lerobot-dataset-v3.mdx.
"""

from __future__ import annotations

import json
from array import array
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import groupby, islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot.errors import RecordingError, need
from robot.exchange.film import AV, AV1, of_size, write_film
from robot.exchange.lerobot_tables import (
    DEGREES,
    PILOT,
    PYARROW,
    ROBOT,
    Columns,
    write_data,
    write_episodes,
    write_tasks,
)
from robot.exchange.steering import done_at
from robot.exchange.timeline import make_timeline
from robot.moves import Move, point_of
from robot.policy.image import Pixels
from robot.recordings.editing import EpisodeFrame, moments
from robot.recordings.edits import Notes
from robot.recordings.episode import Episode
from robot.recordings.messages import Topic
from robot.types import Action, Point

CAMERA = "observation.images.front"
TASK = "Drive as the pilot taught."
_FILES_A_CHUNK = 1000
_FILMS = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
_KEY_EVERY = 2
"""Number of pictures per key frame. Loaders read frames in random order, and decode each frame from
the key frame before it.
"""
_AS_LEROBOT: dict[str, Any] = {"codec": AV1, "crf": 30, "preset": "12"}
"""The settings with which LeRobot 0.6 encodes films. Datasets can be merged only if their films
have the same codec, because a merge copies the films' bytes."""
_STEERED = ("steering.pos", "throttle.vel")
"""Names of the elements of an action, the same as in our package for LeRobot
(docs/examples/lerobot)."""
RESULTS = "meta/drivelesson_results.json"
"""File with the results of extensions, by recording. The file is missing if no extension has
results."""
FPS = 20
"""Default number of pictures per second of a dataset. Datasets can be merged only if this number is
the same for all."""
SENSORS = "sensors"
_SENSORS = ("distance_m", "bumped", "battery")
_NOTHING = 1e30
"""A larger reading means that the sensor saw nothing; only older recordings contain such
readings."""
_QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
_STATISTICS = ("min", "max", "mean", "std", *_QUANTILES)
_OWN = ("intervention", PILOT, DEGREES, SENSORS)
"""Columns that LeRobot itself does not record. Only an export with `--plain` leaves these columns
out."""
_STANDS = Point(0.0, 0.0)
_CARD = """---
task_categories: [robotics]
tags: [LeRobot, drivelesson]
configs:
- config_name: default
  data_files: data/*/*.parquet
---

A LeRobot dataset, written by Drivelesson. `meta/info.json` says what is in it.
"""
Stats = dict[str, dict[str, list[Any]]]
"""Minimum, maximum, mean, standard deviation, quantiles and count, by feature."""


class _Part(NamedTuple):
    """A LeRobot episode: some pictures of one recording, evenly spaced in time."""

    source: int
    episode: Episode
    notes: Notes
    places: NDArray[np.int64]
    """The indices of the pictures in the recording, in order. A picture may occur several times."""
    times_s: NDArray[np.float64]
    labels: set[Action]


_Shown = tuple[Episode, tuple[Move, ...], EpisodeFrame]
"""A picture's recording, the moves that the recording's robot declared, and the picture's data."""


def write_lerobot(
    episodes: Sequence[tuple[Episode, Notes]],
    folder: Path,
    *,
    fps: int = FPS,
    task: str = TASK,
    plain: bool = False,
) -> int:
    """Write recordings as one dataset; return its number of LeRobot episodes.

    `fps` is the number of pictures per second; `task` describes the robot's task. The columns of a
    dataset depend only on the robot's moves, so datasets of one robot can be merged. A `plain`
    dataset contains only taught frames. It has the same columns as a dataset that the command
    `lerobot-record` makes with the same robot, so the two can be merged. Raises RecordingError if
    there are no pictures.
    """
    need(*PYARROW)
    need(*AV)
    rate = fps
    parts = [
        part
        for source, (episode, notes) in enumerate(episodes)
        for part in _split(source, episode, notes, rate, plain)
    ]
    if not parts:
        raise RecordingError("there are no pictures to export")
    table = _Table(parts, rate)
    columns, features = table.columns, table.features
    for name in _OWN if plain else ():
        features.pop(name)
    folder.mkdir(parents=True)
    rows, seen = [], np.zeros((3, 256), np.int64)
    first, frames = parts[0], _frames(parts)
    shown = first.episode.frame(int(first.episode.frames.ids[first.places[0]]))
    size = shown.width, shown.height
    end = 0
    for index, part in enumerate(parts):
        begin, end = end, end + len(part.places)
        chunk, file = divmod(index, _FILES_A_CHUNK)
        name = _FILMS.format(video_key=CAMERA, chunk_index=chunk, file_index=file)
        counts = np.zeros_like(seen)
        pictures = _pictures(islice(frames, len(part.places)), size, counts, table)
        write_film(
            pictures,
            folder / name,
            rate,
            key_every=_KEY_EVERY,
            **(_AS_LEROBOT if plain else {"preset": "ultrafast"}),
        )
        seen += counts
        part_columns = {name: columns[name][begin:end] for name in features}
        rows.append(_episode_row(part_columns, counts, (chunk, file), rate, task))
    columns = {name: columns[name] for name in features}
    write_data(folder, columns)
    write_episodes(folder, rows)
    write_tasks(folder, task)
    info = {
        "codebase_version": "v3.0",
        "robot_type": ROBOT,
        "total_episodes": len(rows),
        "total_frames": len(columns["index"]),
        "total_tasks": 1,
        "chunks_size": _FILES_A_CHUNK,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": rate,
        "splits": {"train": f"0:{len(rows)}"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": _FILMS,
        "features": {CAMERA: _film_feature(size, rate, "av1" if plain else "h264"), **features},
    }
    for name, value in {"info": info, "stats": _stats(columns, seen)}.items():
        (folder / f"meta/{name}.json").write_text(json.dumps(value, indent=4), encoding="utf-8")
    results = [{"episode": e.id, **result} for e, _ in episodes for result in e.results]
    if results:  # written to a separate file, because LeRobot checks the fields of info.json
        (folder / RESULTS).write_text(json.dumps(results, indent=4), encoding="utf-8")
    (folder / "README.md").write_text(_CARD, encoding="utf-8")
    return len(parts)


def _split(source: int, episode: Episode, notes: Notes, fps: int, taught_only: bool) -> list[_Part]:
    places, times_s, labels = array("q"), array("d"), list[Action | None]()
    for place, moment in enumerate(moments(episode, notes, about=())):
        if not moment.is_deleted and (moment.label is not None or not taught_only):
            places.append(place)
            times_s.append(moment.at_s)
            labels.append(moment.label)
    return [
        _Part(
            source=source,
            episode=episode,
            notes=notes,
            places=np.frombuffer(places, np.int64)[stretch],
            times_s=np.frombuffer(times_s)[stretch],
            labels={label for label in dict.fromkeys(map(labels.__getitem__, stretch)) if label},
        )
        for stretch in make_timeline(times_s).evenly(fps)
    ]


def _frames(parts: Sequence[_Part]) -> Iterator[_Shown]:
    """Yield the pictures of all parts, in order. Each recording is read once, chunk by chunk."""
    for _, same in groupby(parts, key=lambda part: part.source):
        of = list(same)
        episode, declared = of[0].episode, of[0].episode.declared_moves
        found = enumerate(moments(episode, of[0].notes, (Topic.DECISION,)))
        place, moment = next(found)
        for wanted in (int(wanted) for part in of for wanted in part.places):
            while place < wanted:
                place, moment = next(found)
            yield episode, declared, moment


def _pictures(
    frames: Iterator[_Shown],
    size: tuple[int, int],
    counts: NDArray[np.int64],
    table: _Table,
) -> Iterator[Pixels]:
    """Yield pictures, shape (height, width, 3), and add their rows to the table. Add the pictures'
    colour histograms to `counts`, shape (3, 256), from which the pictures' statistics are
    computed."""
    import cv2

    histogram = partial(cv2.calcHist, mask=None, histSize=[256], ranges=[0, 256])
    for episode, declared, moment in frames:
        picture = of_size(episode.frame(moment.frame_id), size)
        for colour, count in enumerate(counts):
            count += histogram([picture], [colour]).ravel().astype(np.int64)
        table.add(declared, moment)
        yield picture


class _Table:
    """The values of all frames, and the description of each column.

    The action of a frame is steering and throttle. If a move of the robot is not defined by
    steering and throttle, the action is instead one number for each move. If the number of every
    move is zero, the robot stands still.
    """

    def __init__(self, parts: Sequence[_Part], fps: int) -> None:
        lengths = [len(part.places) for part in parts]
        count = sum(lengths)
        within = np.concatenate([np.arange(length, dtype=np.int64) for length in lengths])
        self._moves = _moves(parts)
        self._is_steered = all(
            point_of(Action(move), declared) is not None
            for declared in {part.source: part.episode.declared_moves for part in parts}.values()
            for move in self._moves
        )
        self._names = [*_STEERED] if self._is_steered else self._moves
        self._row = 0
        self.columns: Columns = {
            "action": np.zeros((count, len(self._names)), np.float32),
            "observation.state": np.zeros((count, len(self._names)), np.float32),
            "intervention": np.zeros(count, bool),
            PILOT: np.full(count, -1, np.int64),
            DEGREES: np.zeros(count, bool),
            SENSORS: np.concatenate([*_sensed(parts)]),
            "timestamp": (within / fps).astype(np.float32),
            "frame_index": within,
            "episode_index": np.repeat(np.arange(len(parts), dtype=np.int64), lengths),
            "index": np.arange(count, dtype=np.int64),
            "task_index": np.zeros(count, np.int64),
        }

    @property
    def features(self) -> dict[str, Any]:
        named = dict.fromkeys(("action", "observation.state"), self._names)
        named[SENSORS] = list(_SENSORS)
        features: dict[str, Any] = {
            name: {
                "dtype": values.dtype.name,
                "shape": [*values.shape[1:]] or [1],
                "names": named.get(name),
            }
            for name, values in self.columns.items()
        }
        features[PILOT]["info"] = {"moves": self._moves}
        return features

    def add(self, declared: tuple[Move, ...], moment: EpisodeFrame) -> None:
        """Add the values of the next frame; `declared` are the moves that its robot declared."""
        row, columns = self._row, self.columns
        done = done_at(moment, declared)
        columns["action"][row] = self._numbers(*done)
        if moment.sent is not None:
            sent = Action(moment.sent)
            done = sent, moment.sent_point or point_of(sent, declared)
        columns["observation.state"][row] = self._numbers(*done)
        columns["intervention"][row] = moment.is_intervention
        if moment.label:
            columns[PILOT][row] = self._moves.index(moment.label)
        columns[DEGREES][row] = self._is_steered and moment.point is not None
        self._row += 1

    def _numbers(self, action: Action, point: Point | None) -> Sequence[float]:
        return (point or _STANDS) if self._is_steered else [action == name for name in self._names]


def _moves(parts: Sequence[_Part]) -> list[str]:
    """Return the moves that the robots declare, and all other moves that occur in the recordings or
    as labels."""
    known = {str(move.name) for part in parts for move in part.episode.declared_moves}
    known |= {str(move) for part in parts for move in (*part.episode.moves, *part.labels)}
    return sorted(known - {str(Action.STOP)})


def _sensed(parts: Sequence[_Part]) -> Iterator[NDArray[np.float32]]:
    """For each part, yield the values that the sensors had at each picture, shape (pictures,
    sensors). The value is the last that the sensor reported. Pictures before a sensor's first value
    get the first value, and all pictures get 0 if the sensor has no value."""
    for _, same in groupby(parts, key=lambda part: part.source):
        of = list(same)
        readings = _readings(of[0].episode)
        for part in of:
            found = np.zeros((len(part.places), len(_SENSORS)), np.float32)
            for column, (times_s, values) in enumerate(readings):
                if len(times_s):
                    at = np.searchsorted(times_s, part.times_s, side="right") - 1
                    found[:, column] = values[at.clip(0)]
            yield found


def _readings(episode: Episode) -> list[tuple[NDArray[np.float64], NDArray[np.float32]]]:
    """Return the times and values of each sensor."""
    start_s, found = episode.start_s, [(array("d"), array("f")) for _ in _SENSORS]
    for now_s, words in episode.messages(Topic.SENSORS):
        for name, (times_s, values) in zip(_SENSORS, found, strict=True):
            value = words.get(name)
            if value is not None and abs(value) < _NOTHING:
                values.append(float(value))
                times_s.append(now_s - start_s)
    return [(np.frombuffer(times_s), np.frombuffer(values, "f")) for times_s, values in found]


def _stats(columns: Columns, counts: NDArray[np.int64]) -> Stats:
    found = {name: _column_stats(values) for name, values in columns.items()}
    return {**found, CAMERA: _brightness_stats(counts, len(columns["index"]))}


def _brightness_stats(counts: NDArray[np.int64], n_pictures: int) -> dict[str, list[Any]]:
    """Return the statistics as shares of full brightness, shape (3, 1, 1), and the count."""
    shares, below = np.arange(256) / 255.0, counts.cumsum(axis=1)
    total = below[:, -1:]
    mean = (counts * shares).sum(axis=1, keepdims=True) / total
    deviations = counts * (shares - mean) ** 2
    ranks: dict[str, NDArray[np.integer | np.floating]] = {
        "min": np.ones_like(total),
        "max": total,
        **{name: q * total for name, q in _QUANTILES.items()},
    }
    found = {name: shares[(below < rank).sum(axis=1)] for name, rank in ranks.items()}
    found |= {"mean": mean, "std": np.sqrt(deviations.sum(axis=1, keepdims=True) / total)}
    plain = {name: np.reshape(of, (3, 1, 1)).tolist() for name, of in found.items()}
    return {**plain, "count": [n_pictures]}


def _column_stats(values: NDArray[Any]) -> dict[str, list[Any]]:
    """Return the statistics of a feature, shape (frames,) or (frames, n)."""
    found: dict[str, list[Any]] = {}
    for column in values.reshape(len(values), -1).T:
        # convert one column at a time to save memory: a recording may last hours
        numbers = column.astype(np.float64)
        own = numbers.min(), numbers.max(), numbers.mean(), numbers.std()
        quantiles = np.quantile(numbers, list(_QUANTILES.values()))
        for name, value in zip(_STATISTICS, (*own, *quantiles), strict=True):
            found.setdefault(name, []).append(float(value))
    return {**found, "count": [len(values)]}


def _episode_row(
    columns: Columns, counts: NDArray[np.int64], place: tuple[int, int], fps: int, task: str
) -> dict[str, Any]:
    length, start = len(columns["index"]), int(columns["index"][0])
    stats = _stats(columns, counts)
    return {
        "episode_index": int(columns["episode_index"][0]),
        "tasks": [task],
        "length": length,
        "data/chunk_index": 0,
        "data/file_index": 0,
        "dataset_from_index": start,
        "dataset_to_index": start + length,
        f"videos/{CAMERA}/chunk_index": place[0],
        f"videos/{CAMERA}/file_index": place[1],
        f"videos/{CAMERA}/from_timestamp": 0.0,
        f"videos/{CAMERA}/to_timestamp": length / fps,
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
        **{f"stats/{name}/{kind}": v for name, of in stats.items() for kind, v in of.items()},
    }


def _film_feature(size: tuple[int, int], fps: int, codec: str) -> dict[str, Any]:
    shape = [size[1] // 2 * 2, size[0] // 2 * 2, 3]  # `write_film` makes the height and width even
    video = {
        "video.height": shape[0],
        "video.width": shape[1],
        "video.codec": codec,
        "video.pix_fmt": "yuv420p",
        "is_depth_map": False,
        "video.fps": fps,
        "video.channels": 3,
        "has_audio": False,
    }
    names = ["height", "width", "channels"]
    return {"dtype": "video", "shape": shape, "names": names, "info": video}
