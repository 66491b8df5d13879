"""LeRobotDataset v3: tables in parquet, pictures as films, written without the lerobot package.

    meta/info.json                                      features, counts, paths
    meta/stats.json                                     of all episodes together
    meta/tasks.parquet                                  task text (the index) and its number
    meta/episodes/chunk-000/file-000.parquet            a row an episode: lengths, files, stats
    data/chunk-000/file-000.parquet                     a row a frame
    videos/observation.images.front/chunk-000/file-NNN.mp4

Timestamps are frame_index / fps exactly, so pictures are resampled to one rate, and a recording is
split where pictures are missing for longer than a second. Source: lerobot, datasets/utils.py,
datasets/dataset_writer.py and docs/source/lerobot-dataset-v3.mdx.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.driver import point_of
from robot.errors import RecordingError
from robot.exchange.film import frame_rate, require_av, write_film
from robot.exchange.lerobot_stats import Brightness, Columns, Stats, column_stats
from robot.exchange.lerobot_tables import (
    PILOT,
    require_pyarrow,
    write_data,
    write_episodes,
    write_json,
    write_tasks,
)
from robot.exchange.timeline import make_timeline
from robot.policy.image import Pixels, to_rgb
from robot.store.episodes.editing import EpisodeFrame, moments
from robot.store.episodes.edits import Notes
from robot.store.episodes.episode import Episode
from robot.store.episodes.messages import SENSORS
from robot.types import Action

CAMERA = "observation.images.front"
TASK = "Drive as the pilot taught."
_FILES_A_CHUNK = 1000
_KEY_EVERY = 2
"""A loader asks for frames in any order: it should have few to decode before each."""
_STEERED = ("angle", "throttle")
_SENSORS = ("distance_m", "bumped", "battery")


@dataclass(frozen=True, slots=True, kw_only=True)
class DatasetPart:
    """One LeRobot episode: moments of a recording at even distances in time."""

    episode: Episode
    moments: list[EpisodeFrame]

    def pictures(self, on_frame: Callable[[], None]) -> Iterator[Pixels]:
        """Read the pictures one after the other."""
        for moment in self.moments:
            on_frame()
            yield to_rgb(self.episode.frame(moment.frame_id))


def write_lerobot(
    episodes: Sequence[tuple[Episode, Notes]],
    folder: Path,
    *,
    fps: int | None = None,
    task: str = TASK,
    robot_type: str | None = None,
    on_frame: Callable[[], None] = lambda: None,
) -> int:
    """Write recordings as one dataset; return how many LeRobot episodes it has.

    Args:
        episodes: Recordings with their edits.
        folder: A new folder.
        fps: Pictures a second; None for the first recording's own.
        task: What the robot was doing, as a text.
        robot_type: Name of the robot; None for the recording's.
        on_frame: Called for each picture.

    Raises:
        MissingExtraError: If pyarrow, av or OpenCV is not installed.
        RecordingError: If there are no pictures.
    """
    require_pyarrow()
    require_av()
    shown = [(episode, moments(episode, notes)) for episode, notes in episodes]
    first = make_timeline([moment.at_s for moment in shown[0][1]])
    rate = fps or frame_rate(first.times_s)
    parts = [part for episode, found in shown for part in _split(episode, found, rate)]
    if not parts:
        raise RecordingError("there are no pictures to export")
    names = [n for n in _SENSORS if any(n in _sensor_series(part.episode) for part in parts)]
    actions, moves = _action_names(parts), _taught_moves(parts)
    folder.mkdir(parents=True)
    tables, rows, start = [], [], 0
    seen = Brightness()
    for index, part in enumerate(parts):
        columns = _columns(part, index, start, rate, names, actions, moves)
        pictures = _write_video(part, folder, index, rate, on_frame)
        seen.join(pictures)
        tables.append(columns)
        rows.append(_episode_row(columns, pictures.stats(), index, start, rate, task))
        start += len(part.moments)
    write_data(folder, tables)
    write_episodes(folder, rows)
    write_tasks(folder, task)
    name = robot_type or episodes[0][0].run.get("robot") or "drivelesson"
    shape = to_rgb(parts[0].episode.frame(parts[0].moments[0].frame_id)).shape
    write_json(folder / "meta/info.json", _info(rows, rate, name, shape, names, actions, moves))
    joined = {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}
    stats = {name: column_stats(values) for name, values in joined.items()}
    write_json(folder / "meta/stats.json", {**stats, CAMERA: seen.stats()})
    return len(parts)


def _split(episode: Episode, found: list[EpisodeFrame], fps: int) -> list[DatasetPart]:
    """Cut where time is missing, and take the nearest picture at each tick of the rate."""
    line = make_timeline([moment.at_s for moment in found])
    kept = [pair for pair in zip(found, line.times_s, strict=True) if not pair[0].is_deleted]
    runs = [kept[:1]] if kept else []
    for (_, before_s), pair in pairwise(kept):
        if pair[1] - before_s > line.gap_s:
            runs.append([])
        runs[-1].append(pair)
    return [DatasetPart(episode=episode, moments=_resample(run, fps)) for run in runs]


def _resample(run: list[tuple[EpisodeFrame, float]], fps: int) -> list[EpisodeFrame]:
    times_s = np.array([at_s for _, at_s in run])
    ticks_s = times_s[0] + np.arange(int((times_s[-1] - times_s[0]) * fps + 0.5) + 1) / fps
    after = np.clip(np.searchsorted(times_s, ticks_s), 0, len(run) - 1)
    before = np.clip(after - 1, 0, len(run) - 1)
    is_before_nearer = ticks_s - times_s[before] < times_s[after] - ticks_s
    return [run[int(i)][0] for i in np.where(is_before_nearer, before, after)]


def _action_names(parts: list[DatasetPart]) -> tuple[str, ...]:
    """Return the names of an action's elements: angle and throttle, or else one for each move."""
    done = [(_done(moment), part.episode) for part in parts for moment in part.moments]
    found = {(action, episode.declared_moves) for action, episode in done}
    if all(point_of(action, declared) is not None for action, declared in found):
        return _STEERED
    return tuple(sorted({str(action) for action, _ in found if action is not Action.STOP}))


def _taught_moves(parts: list[DatasetPart]) -> list[str]:
    return sorted({str(m.label) for part in parts for m in part.moments if m.label is not None})


def _numbers(action: Action, episode: Episode, names: tuple[str, ...]) -> tuple[float, ...]:
    if names == _STEERED:
        return point_of(action, episode.declared_moves) or (0.0, 0.0)
    return tuple(float(action == name) for name in names)  # all zero: it stands


def _columns(
    part: DatasetPart,
    index: int,
    start: int,
    fps: int,
    sensors: list[str],
    names: tuple[str, ...],
    moves: list[str],
) -> Columns:
    count = len(part.moments)
    done = [_done(moment) for moment in part.moments]
    columns: Columns = {
        "action": np.array([_numbers(a, part.episode, names) for a in done], np.float32),
        "intervention": np.array([m.is_intervention for m in part.moments], bool),
        PILOT: np.array([moves.index(m.label) if m.label else -1 for m in part.moments], np.int64),
        "timestamp": (np.arange(count) / fps).astype(np.float32),
        "frame_index": np.arange(count, dtype=np.int64),
        "episode_index": np.full(count, index, np.int64),
        "index": np.arange(start, start + count, dtype=np.int64),
        "task_index": np.zeros(count, np.int64),
    }
    if sensors:
        series = _sensor_series(part.episode)
        columns["observation.state"] = np.stack(
            [_at(series.get(name), part) for name in sensors], axis=1
        )
    return columns


def _done(moment: EpisodeFrame) -> Action:
    """Return what was right at this picture: the pilot's label, or else what was sent."""
    return moment.label or Action(moment.sent or Action.STOP)


def _sensor_series(episode: Episode) -> dict[str, tuple[NDArray[Any], NDArray[Any]]]:
    """Return times and values of each sensor that the robot has."""
    found = {}
    for name in _SENSORS:
        said = [
            (now_s - episode.start_s, float(words[name]))
            for now_s, words in episode.messages.get(SENSORS, [])
            if words.get(name) is not None
        ]
        if said:
            times_s, values = zip(*said, strict=True)
            found[name] = (np.array(times_s), np.array(values, np.float32))
    return found


def _at(series: tuple[NDArray[Any], NDArray[Any]] | None, part: DatasetPart) -> NDArray[Any]:
    """Return a sensor's last value at each picture; before the first, the first; else 0."""
    if series is None:
        return np.zeros(len(part.moments), np.float32)
    times_s, values = series
    at = np.searchsorted(times_s, [moment.at_s for moment in part.moments], side="right") - 1
    return values[np.clip(at, 0, None)]


# Films -------------------------------------------------------------------------------------------


def _video_file(index: int) -> tuple[int, int, str]:
    chunk, file = divmod(index, _FILES_A_CHUNK)
    return chunk, file, f"videos/{CAMERA}/chunk-{chunk:03d}/file-{file:03d}.mp4"


def _write_video(
    part: DatasetPart, folder: Path, index: int, fps: int, on_frame: Callable[[], None]
) -> Brightness:
    """Write the film of one episode, and return what its pictures are made of."""
    path = folder / _video_file(index)[2]
    path.parent.mkdir(parents=True, exist_ok=True)
    shown = Brightness()
    write_film(map(shown.add, part.pictures(on_frame)), path, fps, key_every=_KEY_EVERY)
    return shown


def _episode_row(
    columns: Columns,
    image_stats: dict[str, list[Any]],
    index: int,
    start: int,
    fps: int,
    task: str,
) -> dict[str, Any]:
    count = len(columns["index"])
    chunk, file, _ = _video_file(index)
    stats: Stats = {name: column_stats(values) for name, values in columns.items()}
    stats[CAMERA] = image_stats
    return {
        "episode_index": index,
        "tasks": [task],
        "length": count,
        "data/chunk_index": 0,
        "data/file_index": 0,
        "dataset_from_index": start,
        "dataset_to_index": start + count,
        f"videos/{CAMERA}/chunk_index": chunk,
        f"videos/{CAMERA}/file_index": file,
        f"videos/{CAMERA}/from_timestamp": 0.0,
        f"videos/{CAMERA}/to_timestamp": count / fps,
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
        "stats": stats,
    }


def _info(
    rows: list[dict[str, Any]],
    fps: int,
    robot_type: str,
    shape: tuple[int, ...],
    sensors: list[str],
    actions: tuple[str, ...],
    moves: list[str],
) -> dict[str, Any]:
    return {
        "codebase_version": "v3.0",
        "robot_type": robot_type,
        "total_episodes": len(rows),
        "total_frames": rows[-1]["dataset_to_index"],
        "total_tasks": 1,
        "chunks_size": _FILES_A_CHUNK,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": fps,
        "splits": {"train": f"0:{len(rows)}"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
        "features": _features(
            fps, (shape[0] // 2 * 2, shape[1] // 2 * 2, 3), sensors, actions, moves
        ),
    }


def _features(
    fps: int,
    shape: tuple[int, int, int],
    sensors: list[str],
    actions: tuple[str, ...],
    moves: list[str],
) -> dict[str, Any]:
    height, width, _ = shape
    video = {
        "video.height": height,
        "video.width": width,
        "video.codec": "h264",
        "video.pix_fmt": "yuv420p",
        "video.is_depth_map": False,
        "video.fps": fps,
        "video.channels": 3,
        "has_audio": False,
    }
    features: dict[str, Any] = {
        CAMERA: {
            "dtype": "video",
            "shape": list(shape),
            "names": ["height", "width", "channels"],
            "info": video,
        },
        "action": {"dtype": "float32", "shape": [len(actions)], "names": list(actions)},
        "intervention": {"dtype": "bool", "shape": [1], "names": None},
        PILOT: {"dtype": "int64", "shape": [1], "names": None, "info": {"moves": moves}},
        "timestamp": {"dtype": "float32", "shape": [1], "names": None},
    }
    if sensors:
        features["observation.state"] = {
            "dtype": "float32",
            "shape": [len(sensors)],
            "names": sensors,
        }
    for name in ("frame_index", "episode_index", "index", "task_index"):
        features[name] = {"dtype": "int64", "shape": [1], "names": None}
    return features
