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
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.errors import RecordingError, need
from robot.exchange.film import AV, write_film
from robot.exchange.lerobot_stats import (
    Columns,
    Stats,
    brightness_stats,
    column_stats,
    count_brightness,
)
from robot.exchange.lerobot_tables import (
    DEGREES,
    PILOT,
    PYARROW,
    write_data,
    write_episodes,
    write_json,
    write_tasks,
)
from robot.exchange.steering import done_at
from robot.exchange.timeline import make_timeline
from robot.policy.image import Pixels, to_rgb
from robot.store.episodes.editing import EpisodeFrame, moments
from robot.store.episodes.edits import Notes
from robot.store.episodes.episode import Episode
from robot.store.episodes.messages import Topic
from robot.types import Action

CAMERA = "observation.images.front"
TASK = "Drive as the pilot taught."
_FILES_A_CHUNK = 1000
_FILMS = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
_KEY_EVERY = 2
"""A loader asks for frames in any order: it should have few to decode before each."""
_STEERED = ("angle", "throttle")
_SENSORS = ("distance_m", "bumped", "battery")


Part = tuple[Episode, list[EpisodeFrame]]
"""One LeRobot episode: a recording, and moments of it at even distances in time."""


def write_lerobot(
    episodes: Sequence[tuple[Episode, Notes]],
    folder: Path,
    *,
    fps: int | None = None,
    task: str = TASK,
    on_frame: Callable[[], None] = lambda: None,
) -> int:
    """Write recordings as one dataset; return how many LeRobot episodes it has.

    Args:
        episodes: Recordings with their edits.
        folder: A new folder.
        fps: Pictures a second; None for the first recording's own.
        task: What the robot was doing, as a text.
        on_frame: Called for each picture.

    Raises:
        MissingExtraError: If pyarrow, av or OpenCV is not installed.
        RecordingError: If there are no pictures.
    """
    need(*PYARROW)
    need(*AV)
    first, notes = episodes[0]
    rate = fps or make_timeline([moment.at_s for moment in moments(first, notes)]).fps
    parts = [part for episode, notes in episodes for part in _split(episode, notes, rate)]
    if not parts:
        raise RecordingError("there are no pictures to export")
    form = _Form(parts, rate)
    folder.mkdir(parents=True)
    tables: list[Columns] = []
    rows, seen = [], np.zeros((3, 256), np.int64)
    for index, part in enumerate(parts):
        columns = form.columns(part, index, sum(len(table["index"]) for table in tables))
        chunk, file = divmod(index, _FILES_A_CHUNK)
        name = _FILMS.format(video_key=CAMERA, chunk_index=chunk, file_index=file)
        counts = np.zeros_like(seen)
        pictures = count_brightness(_pictures(part, on_frame), counts)
        write_film(pictures, folder / name, rate, key_every=_KEY_EVERY)
        seen += counts
        tables.append(columns)
        rows.append(_episode_row(columns, counts, (chunk, file), rate, task))
    joined = {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}
    write_data(folder, joined)
    write_episodes(folder, rows)
    write_tasks(folder, task)
    info = {
        "codebase_version": "v3.0",
        "robot_type": first.run.get("robot") or "drivelesson",
        "total_episodes": len(rows),
        "total_frames": len(joined["index"]),
        "total_tasks": 1,
        "chunks_size": _FILES_A_CHUNK,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": rate,
        "splits": {"train": f"0:{len(rows)}"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": _FILMS,
        "features": {CAMERA: _film_feature(parts[0], rate), **form.features(joined)},
    }
    write_json(folder / "meta/info.json", info)
    write_json(folder / "meta/stats.json", _stats(joined, seen))
    return len(parts)


def _split(episode: Episode, notes: Notes, fps: int) -> list[Part]:
    kept = [moment for moment in moments(episode, notes) if not moment.is_deleted]
    stretches = make_timeline([moment.at_s for moment in kept]).evenly(fps)
    return [(episode, [kept[i] for i in stretch]) for stretch in stretches]


def _pictures(part: Part, on_frame: Callable[[], None]) -> Iterator[Pixels]:
    """Read the pictures one after the other."""
    episode, taken = part
    for moment in taken:
        on_frame()
        yield to_rgb(episode.frame(moment.frame_id))


class _Form:
    """The columns that all parts of a dataset have."""

    def __init__(self, parts: list[Part], fps: int) -> None:
        self._fps = fps
        labels = {moment.label for _, taken in parts for moment in taken}
        self._moves = sorted(str(label) for label in labels if label is not None)
        self._sensors = [n for n in _SENSORS if any(len(_readings(of, n)) for of, _ in parts)]
        done = {done_at(m, of.declared_moves) for of, taken in parts for m in taken}
        self._actions = [*_STEERED]
        if any(point is None for _, point in done):
            self._actions = sorted({str(action) for action, _ in done if action is not Action.STOP})
        self._is_by_degrees = self._actions == [*_STEERED] and any(
            moment.point is not None for _, taken in parts for moment in taken
        )

    def columns(self, part: Part, index: int, start: int) -> Columns:
        """Return the values of one episode, whose first frame has the number `start` of all."""
        episode, taken = part
        count = len(taken)
        taught = [self._moves.index(m.label) if m.label else -1 for m in taken]
        columns: Columns = {
            "action": np.array([self._action(episode, m) for m in taken], np.float32),
            "intervention": np.array([m.is_intervention for m in taken], bool),
            PILOT: np.array(taught, np.int64),
            "timestamp": (np.arange(count) / self._fps).astype(np.float32),
            "frame_index": np.arange(count, dtype=np.int64),
            "episode_index": np.full(count, index, np.int64),
            "index": np.arange(start, start + count, dtype=np.int64),
            "task_index": np.zeros(count, np.int64),
        }
        if self._is_by_degrees:
            columns[DEGREES] = np.array([m.point is not None for m in taken], bool)
        if self._sensors:
            sensed = [_sensed(part, name) for name in self._sensors]
            columns["observation.state"] = np.stack(sensed, axis=1).astype(np.float32)
        return columns

    def features(self, columns: Columns) -> dict[str, Any]:
        """Describe the columns."""
        names = {"action": self._actions, "observation.state": self._sensors}
        found: dict[str, Any] = {
            name: {
                "dtype": values.dtype.name,
                "shape": [*values.shape[1:]] or [1],
                "names": names.get(name),
            }
            for name, values in columns.items()
        }
        found[PILOT]["info"] = {"moves": self._moves}
        return found

    def _action(self, episode: Episode, moment: EpisodeFrame) -> tuple[float, ...]:
        """Return angle and throttle, or else a number for each move; all zero: it stands."""
        done, point = done_at(moment, episode.declared_moves)
        if self._actions == [*_STEERED]:
            return point or (0.0, 0.0)
        return tuple(float(done == name) for name in self._actions)


def _readings(episode: Episode, name: str) -> NDArray[np.float64]:
    """Return when a sensor said what, shape (n, 2)."""
    said = [
        (now_s - episode.start_s, float(words[name]))
        for now_s, words in episode.messages.get(Topic.SENSORS, [])
        if words.get(name) is not None
    ]
    return np.array(said).reshape(-1, 2)


def _sensed(part: Part, name: str) -> NDArray[np.float64]:
    """Return a sensor's last value at each picture; before the first, the first; else 0."""
    episode, taken = part
    readings = _readings(episode, name)
    if not len(readings):
        return np.zeros(len(taken))
    times_s = [moment.at_s for moment in taken]
    at = np.searchsorted(readings[:, 0], times_s, side="right") - 1
    found: NDArray[np.float64] = readings[np.clip(at, 0, None), 1]
    return found


def _stats(columns: Columns, counts: NDArray[np.int64]) -> Stats:
    found = {name: column_stats(values) for name, values in columns.items()}
    return {**found, CAMERA: brightness_stats(counts, len(columns["index"]))}


def _episode_row(
    columns: Columns, counts: NDArray[np.int64], place: tuple[int, int], fps: int, task: str
) -> dict[str, Any]:
    length, start = len(columns["index"]), int(columns["index"][0])
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
        "stats": _stats(columns, counts),
    }


def _film_feature(part: Part, fps: int) -> dict[str, Any]:
    height, width, _ = next(_pictures(part, lambda: None)).shape
    shape = [height // 2 * 2, width // 2 * 2, 3]  # as `write_film` leaves them
    video = {
        "video.height": shape[0],
        "video.width": shape[1],
        "video.codec": "h264",
        "video.pix_fmt": "yuv420p",
        "video.is_depth_map": False,
        "video.fps": fps,
        "video.channels": 3,
        "has_audio": False,
    }
    names = ["height", "width", "channels"]
    return {"dtype": "video", "shape": shape, "names": names, "info": video}
