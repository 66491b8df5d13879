"""Writes numbered pictures and donkeycar tubs of them, and reads the results of imports."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable
from functools import cache, partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.devkit.pictures import Picture
from robot.exchange.drive import Drive, FrameEvent, ImportReport, write_episode
from robot.exchange.reading import Reading
from robot.exchange.sources import find_drives
from robot.policy.image import to_rgb
from robot.recordings.episode import Episode, open_episode, taught_frames
from robot.types import Action, Encoding, Frame, Point

Record = dict[str, Any]
_GREY = 20
"""Brightness for each number; the steps are so large that JPEG and films preserve them."""


@cache
def picture(number: int, ending: str = ".jpg") -> bytes:
    """Return a picture of 160x120 pixels whose brightness is its number, from 0 to 12."""
    assert 0 <= number <= 12
    return cv2.imencode(ending, pixels(number))[1].tobytes()


def pixels(number: int) -> NDArray[np.uint8]:
    return np.full((120, 160, 3), _GREY * number, np.uint8)


def number_of(frame: Frame) -> int:
    return round(float(to_rgb(frame).mean()) / _GREY)


def put(folder: Path, *names: str) -> Path:
    """Write pictures with the numbers from 1 on; return the folder."""
    for number, name in enumerate(names, 1):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(picture(number, path.suffix if path.suffix == ".png" else ".jpg"))
    return folder


def tub_1(folder: Path, records: list[Record]) -> Path:
    """Write a tub of version 1, with a record each 50 ms; its pictures are numbered from 1."""
    put(folder, *_named(records))
    for number, record in enumerate(records):
        text = json.dumps({"milliseconds": 50 * number, **record})
        (folder / f"record_{number}.json").write_text(text)
    (folder / "meta.json").write_text("{}")
    return folder


def tub_2(folder: Path, records: list[Record], deleted: tuple[int, ...] = ()) -> Path:
    """Write a tub of version 2, with a record each 100 ms and six in a catalog; its pictures are
    numbered from 1."""
    put(folder / "images", *_named(records))
    for index, record in enumerate(records):
        record.update(
            {"_index": index} | {"_timestamp_ms": 1_600_000_000_000 + 100 * index} | record
        )
    paths = [f"catalog_{number}.catalog" for number in range((len(records) + 5) // 6)]
    for number, name in enumerate(paths):
        text = "".join(json.dumps(record) + "\n" for record in records[6 * number : 6 * number + 6])
        (folder / name).write_text(text)
    catalogs = {"paths": paths, "current_index": len(records), "max_len": 6}
    catalogs["deleted_indexes"] = list(deleted)
    lines = [["cam/image_array"], ["image_array"], {}, {"created_at": 1.6e9}, catalogs]
    (folder / "manifest.json").write_text("".join(json.dumps(line) + "\n" for line in lines))
    return folder


def _named(records: list[Record]) -> list[str]:
    """Add a picture's name to each record without one; return the names of all pictures."""
    names = [f"{number}_cam_image_array_.jpg" for number in range(len(records))]
    for name, record in zip(names, records, strict=True):
        record.setdefault("cam/image_array", name)
    return names


def import_pictures(
    path: Path,
    pictures: Iterable[NDArray[np.uint8]],
    labels: Iterable[Action | None],
    times_s: Iterable[float] | None = None,
    points: Iterable[Point | None] = itertools.repeat(None),
    **drive: Any,
) -> Episode:
    """Write a drive of RGB pictures, shape (height, width, 3), and open it; without times, ten a
    second."""
    times_s = times_s if times_s is not None else (i / 10 for i in itertools.count())
    shots = [
        FrameEvent(t_s=at_s, picture=partial(raw, shown), label=label, point=point)
        for at_s, shown, label, point in zip(times_s, pictures, labels, points, strict=False)
    ]
    write_episode(Drive(name=path.stem, shots=shots, **{"source": "test", **drive}), path)
    return open_episode(path)


def raw(shown: NDArray[np.uint8]) -> Picture:
    height, width = shown.shape[:2]
    return Picture(data=shown.tobytes(), encoding=Encoding.RGB, width=width, height=height)


def taught_labels(episode: Episode) -> dict[int, Action]:
    """Return the label of each taught frame."""
    return {frame_id: example.label for frame_id, example in taught_frames(episode).items()}


def labels_by_number(episode: Episode) -> dict[int, Action | None]:
    """Return the label of each picture (None if not taught), by the number in the picture."""
    labels = taught_labels(episode)
    return {number_of(episode.frame(i)): labels.get(i) for i in episode.frames}


def drive_at(path: Path, report: ImportReport | None = None, **reading: Any) -> Drive:
    """Read the single drive at a path."""
    [source] = find_drives(path)
    return source.read(Reading(**reading), report or ImportReport())


def import_from(path: Path, target: Path, **reading: Any) -> Episode:
    """Import the single drive at a path, and open it."""
    write_episode(drive_at(path, **reading), target)
    return open_episode(target)
