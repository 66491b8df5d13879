"""Drives that were imported: made of pictures and labels, or read from the files of a program."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.devkit.pictures import Picture
from robot.exchange.drive import Drive, FrameEvent, ImportReport, write_episode
from robot.exchange.reading import Reading
from robot.exchange.sources import find_drives
from robot.recordings.episode import Episode, open_episode, taught_frames
from robot.types import Action, Encoding, Point


def import_pictures(
    path: Path,
    pictures: Iterable[NDArray[np.uint8]],
    labels: Iterable[Action | None],
    times_s: Iterable[float] | None = None,
    points: Iterable[Point | None] = itertools.repeat(None),
    **drive: Any,
) -> Episode:
    """Write a drive of RGB pictures, shape (height, width, 3), ten a second if no times are given,
    and open it."""
    times_s = times_s if times_s is not None else (i / 10 for i in itertools.count())
    shots = [
        FrameEvent(t_s=at_s, picture=partial(raw, pixels), label=label, point=point)
        for at_s, pixels, label, point in zip(times_s, pictures, labels, points, strict=False)
    ]
    write_episode(Drive(name=path.stem, shots=shots, **{"source": "test", **drive}), path)
    return open_episode(path)


def raw(pixels: NDArray[np.uint8]) -> Picture:
    height, width = pixels.shape[:2]
    return Picture(data=pixels.tobytes(), encoding=Encoding.RGB, width=width, height=height)


def taught_labels(episode: Episode) -> dict[int, Action]:
    """Return the label of each frame that was taught."""
    return {frame_id: example.label for frame_id, example in taught_frames(episode).items()}


def drive_at(path: Path, report: ImportReport | None = None, **reading: Any) -> Drive:
    """Read the single drive at a path."""
    [source] = find_drives(path)
    return source.read(Reading(**reading), report or ImportReport())


def import_from(path: Path, target: Path, **reading: Any) -> Episode:
    """Import the single drive at a path, and open it."""
    write_episode(drive_at(path, **reading), target)
    return open_episode(target)
