"""`.npz` recordings for the evaluation: JPEG frames in time order, each with a label.

Frames may also have the steering (`angle`) and the `throttle`; if these are NaN, only the label
counts. If a recording contains `angle_mean`, this angle is used instead of `angle`, and the labels
were made from it. `angle_mean` is the mean angle over a short time, because the angle itself jumps
when a pilot taps the steering.
"""

from __future__ import annotations

import json
import math
import shutil
import tempfile
import zipfile
from array import array
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from robot.devkit.pictures import read_picture
from robot.errors import RecordingError, told_as
from robot.exchange.drive import Drive, FrameEvent, ImportReport, drive_of
from robot.exchange.film import of_size, to_jpeg
from robot.exchange.timeline import make_timeline
from robot.recordings.editing import EpisodeFrame, moments
from robot.recordings.edits import Notes
from robot.recordings.episode import Episode
from robot.store.npz import read_arrays
from robot.types import DEFAULT_MOVES, Encoding, Point

SIZE = 160, 120
_STEERED = "angle", "throttle"
_MEAN = "angle_mean"
_UNKNOWN = Point(math.nan, math.nan)
_COPIED_BYTES = 1 << 20
MAX_BYTES = 512 * 2**20
"""Largest unpacked size of a recording, in bytes. Larger recordings are refused."""


def load_recording(path: Path | str, report: ImportReport | None = None) -> Drive:
    """Read one `.npz` recording; code that the file may contain is never run.

    The recording's pictures are JPEGs of 160x120, each with a label and a time. Raises
    RecordingError if the file is missing, broken or in another format.
    """
    path = Path(path)
    wrong = f"the recording {path} cannot be read"
    with told_as(RecordingError, wrong, OSError, RecordingError), path.open("rb") as file:
        arrays = read_arrays(file.read(MAX_BYTES + 1), max_bytes=MAX_BYTES)
    return _checked(path, arrays, report or ImportReport())


def is_example(moment: EpisodeFrame) -> bool:
    """True if `write_npz` exports this picture: its label must be one of the format's three."""
    return not moment.is_deleted and moment.label in DEFAULT_MOVES


def write_npz(episode: Episode, notes: Notes, path: Path) -> int:
    """Write the taught pictures of an episode as a recording; return their number.

    A JPEG of 160x120 is written unchanged; other pictures are scaled and encoded. The format has
    only three labels, so pictures with other labels are left out. Raises RecordingError if no
    picture is left.
    """
    labels, ends, times_s = array("B"), array("q", [0]), array("d")
    points = array("f"), array("f")
    # Collect the pictures in a file, because they may not fit into memory.
    # The pictures are written last, because the array's header needs their total length.
    with tempfile.TemporaryFile(dir=path.parent) as pictures:
        for moment in moments(episode, notes, about=()):
            if is_example(moment):
                frame = episode.frame(moment.frame_id)
                is_kept = frame.encoding is Encoding.JPEG and (frame.width, frame.height) == SIZE
                data = frame.data if is_kept else to_jpeg(of_size(frame, SIZE)).data
                pictures.write(data)
                ends.append(ends[-1] + len(data))
                labels.append(DEFAULT_MOVES.index(moment.label))
                times_s.append(moment.at_s)
                for shares, share in zip(points, moment.point or _UNKNOWN, strict=True):
                    shares.append(share)
        if not labels:
            raise RecordingError(
                "there are no pictures to export: this format has only forward, left and right, "
                "and no picture has one of these labels"
            )
        steered = dict(
            zip(_STEERED, (np.array(shares, np.float32) for shares in points), strict=True)
        )
        about = {"source": "drivelesson", "episode": episode.id}
        found = {"results": episode.results} if episode.results else {}
        columns: dict[str, NDArray[Any]] = {
            **({} if np.isnan([*steered.values()]).all() else steered),
            "offsets": np.array(ends, np.int64),
            "labels": np.array(labels, np.uint8),
            "t": np.array(make_timeline(times_s).times_s, np.float32),
            "meta": np.array(json.dumps({**about, **found})),
        }
        _write_npz(path, columns, pictures, ends[-1])
    return len(labels)


def _write_npz(
    path: Path, columns: Mapping[str, NDArray[Any]], pictures: IO[bytes], size: int
) -> None:
    """Write the file like `np.savez`. The pictures are copied from an open file, because they may
    not fit into memory."""
    header = {"descr": "|u1", "fortran_order": False, "shape": (size,)}
    with zipfile.ZipFile(path, "x") as archive:
        with archive.open("jpeg.npy", "w", force_zip64=True) as member:
            np.lib.format.write_array_header_1_0(member, header)
            pictures.seek(0)
            shutil.copyfileobj(pictures, member, _COPIED_BYTES)
        for name, values in columns.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, values)


def _checked(path: Path, arrays: dict[str, NDArray[Any]], report: ImportReport) -> Drive:
    def refuse_if(is_wrong: Any, what: str) -> None:
        if is_wrong:
            raise RecordingError(f"the recording {path} {what}")

    missing = [name for name in ("jpeg", "offsets", "labels", "t") if name not in arrays]
    export = "drivelesson episodes export NAME --as npz"
    refuse_if(missing, f"has no {', '.join(missing)}, so it was not written by: {export}")
    jpeg, offsets, labels, t = (arrays[name] for name in ("jpeg", "offsets", "labels", "t"))
    n_frames = labels.size
    is_well_formed = (
        jpeg.dtype == np.uint8
        and offsets.dtype.kind in "iu"
        and labels.dtype.kind in "iu"
        and t.dtype.kind in "fiu"
        and offsets.shape == (n_frames + 1,)
        and labels.shape == t.shape == (n_frames,)
        and n_frames > 0
    )
    refuse_if(not is_well_formed, "has an array of a wrong shape or type")
    is_cut = offsets[0] != 0 or offsets[-1] != jpeg.size
    lengths = np.diff(offsets.astype(np.int64))
    refuse_if(is_cut or (lengths <= 0).any(), "has pictures that overlap, or end after its data")
    is_known = int(labels.min()) >= 0 and int(labels.max()) < len(DEFAULT_MOVES)
    refuse_if(not is_known, "has labels other than 0, 1 and 2")
    refuse_if(not np.isfinite(t).all(), "has times that are not numbers")
    data, points = jpeg.tobytes(), _points(path, arrays, n_frames)

    def read(place: str, index: int) -> FrameEvent:
        begin, end = offsets[index : index + 2].tolist()
        return FrameEvent(
            place=place,
            t_s=float(t[index]),
            label=DEFAULT_MOVES[int(labels[index])],
            point=points[index],
            picture=partial(read_picture, data[begin:end], f"a picture of {path.name}"),
        )

    found = ((f"frame {index}", index) for index in range(n_frames))
    return drive_of(found, read, str(path), name=path.stem, source="npz", report=report)


def _points(path: Path, arrays: dict[str, NDArray[Any]], n_frames: int) -> tuple[Point | None, ...]:
    names = (_MEAN if _MEAN in arrays else _STEERED[0], _STEERED[1])
    if not set(names) <= set(arrays):
        return (None,) * n_frames
    steered = [arrays[name] for name in names]
    if any(of.shape != (n_frames,) or of.dtype.kind != "f" for of in steered):
        raise RecordingError(f"the recording {path} has an angle or throttle of a wrong type")
    if any((np.abs(of) > 1.0).any() for of in steered):
        raise RecordingError(f"the recording {path} has an angle or throttle outside -1 to 1")
    found = zip(*(of.tolist() for of in steered), strict=True)
    return tuple(None if math.isnan(sum(pair)) else Point(*pair) for pair in found)
