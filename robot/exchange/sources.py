"""Chooses the reader for a path."""

from __future__ import annotations

from pathlib import Path

from robot.errors import RecordingError
from robot.exchange.drive import Drive
from robot.exchange.folder import read_folder
from robot.exchange.npz import read_npz
from robot.exchange.steering import DEFAULT_THRESHOLD
from robot.exchange.tub import is_tub, read_tub


def read_drive(path: Path, threshold: float = DEFAULT_THRESHOLD) -> Drive:
    """Read a donkeycar tub (1 or 2), a folder of pictures with a CSV table, or an `.npz`.

    Raises:
        RecordingError: If it is none of these, or broken.
    """
    if path.is_dir():
        return read_tub(path, threshold) if is_tub(path) else read_folder(path, threshold)
    if path.suffix == ".npz":
        return read_npz(path)
    if path.suffix == ".csv" and path.is_file():
        return read_folder(path.parent, threshold, table=path)
    raise RecordingError(
        f"{path} is neither a donkeycar tub, nor a folder with a CSV table, nor an .npz recording"
    )
