"""Writes LeRobotDataset v3 (parquet tables, pictures as films) without the lerobot package.

    meta/info.json                                      features, counts, paths
    meta/stats.json                                     of all episodes together
    meta/tasks.parquet                                  task text (the index) and its number
    meta/episodes/chunk-000/file-000.parquet            a row an episode: lengths, files, stats
    data/chunk-000/file-000.parquet                     a row a frame
    videos/observation.images.front/chunk-000/file-NNN.mp4

Timestamps are frame_index / fps exactly, so pictures are resampled to one rate, and a recording is
split where pictures are missing for longer than a second. All pictures are scaled to the size of
the first.
Source: lerobot, datasets/utils.py, dataset_writer.py and docs/source/lerobot-dataset-v3.mdx.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.driver import point_of
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
"""Number of pictures per key frame. Loaders read frames in any order, and decode from a key frame.
"""
_AS_LEROBOT: dict[str, Any] = {"codec": AV1, "crf": 30, "preset": "12"}
"""Encoder settings of LeRobot 0.6. Datasets only merge if their films have the same codec, because
the films' bytes are copied."""
_STEERED = ("steering.pos", "throttle.vel")
"""Names of the action's elements in the package for LeRobot (docs/examples/lerobot)."""
RESULTS = "meta/drivelesson_results.json"
"""File with the results of extensions, by recording; written only if there are any."""
FPS = 20
"""Default number of pictures per second of a dataset. Datasets only merge if their rates are
equal."""
SENSORS = "sensors"
_SENSORS = ("distance_m", "bumped", "battery")
_QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
_OWN = ("intervention", PILOT, DEGREES, SENSORS)
"""Columns that only this program writes; a plain dataset omits them."""
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

Part = tuple[Episode, list[EpisodeFrame]]
"""One LeRobot episode: a recording, and some of its moments, evenly spaced in time."""


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
    dataset contains only taught frames, with the columns that LeRobot's command records from our
    robots, so it can be merged with datasets recorded by LeRobot.
    Raises RecordingError if there are no pictures.
    """
    need(*PYARROW)
    need(*AV)
    rate = fps
    parts = [part for episode, notes in episodes for part in _split(episode, notes, rate, plain)]
    if not parts:
        raise RecordingError("there are no pictures to export")
    columns, features = _table(parts, rate)
    for name in _OWN if plain else ():
        columns.pop(name), features.pop(name)
    folder.mkdir(parents=True)
    rows, seen = [], np.zeros((3, 256), np.int64)
    shown = parts[0][0].frame(parts[0][1][0].frame_id)
    size = shown.width, shown.height
    for index, part in enumerate(parts):
        chunk, file = divmod(index, _FILES_A_CHUNK)
        name = _FILMS.format(video_key=CAMERA, chunk_index=chunk, file_index=file)
        counts = np.zeros_like(seen)
        pictures = _pictures(part, size, counts)
        write_film(
            pictures, folder / name, rate, key_every=_KEY_EVERY, **(_AS_LEROBOT if plain else {})
        )
        seen += counts
        own = columns["episode_index"] == index
        part_columns = {name: values[own] for name, values in columns.items()}
        rows.append(_episode_row(part_columns, counts, (chunk, file), rate, task))
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
    if results:  # not in info.json, because LeRobot checks the fields of that file
        (folder / RESULTS).write_text(json.dumps(results, indent=4), encoding="utf-8")
    (folder / "README.md").write_text(_CARD, encoding="utf-8")
    return len(parts)


def _split(episode: Episode, notes: Notes, fps: int, taught_only: bool) -> list[Part]:
    kept = [
        moment
        for moment in moments(episode, notes)
        if not moment.is_deleted and (moment.label is not None or not taught_only)
    ]
    stretches = make_timeline([moment.at_s for moment in kept]).evenly(fps)
    return [(episode, [kept[i] for i in stretch]) for stretch in stretches]


def _pictures(part: Part, size: tuple[int, int], counts: NDArray[np.int64]) -> Iterator[Pixels]:
    """Yield pictures, shape (height, width, 3), and add their colour histograms to `counts`, shape
    (3, 256), from which all statistics are computed."""
    episode, taken = part
    for moment in taken:
        picture = of_size(episode.frame(moment.frame_id), size)
        counts += [np.bincount(colour, minlength=256) for colour in picture.reshape(-1, 3).T]
        yield picture


def _table(parts: list[Part], fps: int) -> tuple[Columns, dict[str, Any]]:
    """Return the values of all frames, and the description of each column.

    The action is steering and throttle. If a move of the robot has no steering and throttle, the
    action is a number for each move. All zero: the robot stands.
    """
    frames = [(of, moment) for of, taken in parts for moment in taken]
    lengths = [len(taken) for _, taken in parts]
    within = np.concatenate([np.arange(length, dtype=np.int64) for length in lengths])
    moves = _moves(parts)
    is_steered = all(
        point_of(Action(move), of.declared_moves) is not None for of, _ in parts for move in moves
    )
    names = [*_STEERED] if is_steered else moves

    def numbers(action: Action, point: Point | None) -> Sequence[float]:
        return (point or _STANDS) if is_steered else [action == name for name in names]

    done = [done_at(moment, of.declared_moves) for of, moment in frames]
    does = [_does(of, moment) for of, moment in frames]
    columns: Columns = {
        "action": np.array([numbers(*each) for each in done], np.float32),
        "observation.state": np.array([numbers(*each) for each in does], np.float32),
        "intervention": np.array([m.is_intervention for _, m in frames], bool),
        PILOT: np.array([moves.index(m.label) if m.label else -1 for _, m in frames], np.int64),
        DEGREES: np.array([is_steered and m.point is not None for _, m in frames], bool),
        SENSORS: np.concatenate([_all_sensed(part) for part in parts]).astype(np.float32),
        "timestamp": (within / fps).astype(np.float32),
        "frame_index": within,
        "episode_index": np.repeat(np.arange(len(parts), dtype=np.int64), lengths),
        "index": np.arange(len(frames), dtype=np.int64),
        "task_index": np.zeros(len(frames), np.int64),
    }
    named = {"action": names, "observation.state": names, SENSORS: list(_SENSORS)}
    features: dict[str, Any] = {
        name: {
            "dtype": values.dtype.name,
            "shape": [*values.shape[1:]] or [1],
            "names": named.get(name),
        }
        for name, values in columns.items()
    }
    features[PILOT]["info"] = {"moves": moves}
    return columns, features


def _moves(parts: list[Part]) -> list[str]:
    """Return all moves of the robots, including unused moves, and all other labels."""
    declared = {str(move.name) for of, _ in parts for move in of.declared_moves}
    known = declared | {str(move) for of, _ in parts for move in of.moves}
    taught = {str(moment.label) for _, taken in parts for moment in taken if moment.label}
    return sorted((known | taught) - {str(Action.STOP)})


def _does(episode: Episode, moment: EpisodeFrame) -> tuple[Action, Point | None]:
    """Return the robot's action at a picture if the action was recorded, else the label."""
    if moment.sent is None:
        return done_at(moment, episode.declared_moves)
    action = Action(moment.sent)
    return action, moment.sent_point or point_of(action, episode.declared_moves)


def _all_sensed(part: Part) -> NDArray[np.float64]:
    """Return each sensor's last value at each picture, shape (pictures, sensors)."""
    return np.stack([_sensed(part, name) for name in _SENSORS], axis=1)


def _readings(episode: Episode, name: str) -> NDArray[np.float64]:
    """Return the times and values of a sensor, shape (n, 2)."""
    said = [
        (now_s - episode.start_s, float(words[name]))
        for now_s, words in episode.messages(Topic.SENSORS)
        if words.get(name) is not None
    ]
    return np.array(said).reshape(-1, 2)


def _sensed(part: Part, name: str) -> NDArray[np.float64]:
    """Return a sensor's last value at each picture. Before the first value it is the first value;
    without values it is 0."""
    episode, taken = part
    readings = _readings(episode, name)
    if not len(readings):
        return np.zeros(len(taken))
    times_s = [moment.at_s for moment in taken]
    at = np.searchsorted(readings[:, 0], times_s, side="right") - 1
    found: NDArray[np.float64] = readings[np.clip(at, 0, None), 1]
    return found


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
    table = values.reshape(len(values), -1).astype(np.float64)
    return {
        "min": table.min(axis=0).tolist(),
        "max": table.max(axis=0).tolist(),
        "mean": table.mean(axis=0).tolist(),
        "std": table.std(axis=0).tolist(),
        **{name: np.quantile(table, q, axis=0).tolist() for name, q in _QUANTILES.items()},
        "count": [len(table)],
    }


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
    shape = [size[1] // 2 * 2, size[0] // 2 * 2, 3]  # `write_film` makes them even
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
