"""Finds what can be imported at a path: in a folder, in folders within it, or in an archive."""

from __future__ import annotations

import contextlib
import tarfile
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import IO, Any

from robot.errors import RecordingError
from robot.exchange.drive import Drive
from robot.exchange.folder import read_folder
from robot.exchange.lerobot_reader import LerobotDataset, is_dataset
from robot.exchange.npz import read_npz
from robot.exchange.report import ImportReport
from robot.exchange.steering import DEFAULT_THRESHOLD
from robot.exchange.tub import read_tub
from robot.exchange.tub_records import is_tub

_DEEPEST = 5
_MOST_UNPACKED_BYTES = 16 * 2**30
_MOST_FILES = 2_000_000
_ENDINGS = (".zip", ".tar", ".tar.gz", ".tgz", ".tar.bz2")
_DAMAGED = (zipfile.BadZipFile, tarfile.TarError, zlib.error, EOFError, OSError, RuntimeError)
Entry = tuple[str, Callable[[], IO[bytes]]]


@dataclass(frozen=True, slots=True)
class Source:
    """Where one drive is: at a path, or an episode of the dataset that is there."""

    path: Path
    episode: int | None = None

    @property
    def name(self) -> str:
        """What a person calls it."""
        return self.path.name if self.episode is None else f"{self.path.name} {self.episode}"

    def read(
        self, threshold: float = DEFAULT_THRESHOLD, report: ImportReport | None = None
    ) -> Drive:
        """Read the drive.

        Raises:
            RecordingError: If it is none that is known, or nothing of it can be used.
        """
        path = self.path
        if self.episode is not None:
            return LerobotDataset(path).read(self.episode, threshold, report)
        if path.is_dir() and is_tub(path):
            return read_tub(path, threshold, report)
        if path.is_dir() and any(path.glob("*.csv")):
            return read_folder(path, threshold, report=report)
        if path.suffix == ".npz":
            return read_npz(path, report)
        if path.suffix == ".csv" and path.is_file():
            return read_folder(path.parent, threshold, table=path, report=report)
        raise RecordingError(
            f"{path} is neither a donkeycar tub, nor a LeRobot dataset, nor a folder with a CSV "
            "table, nor an .npz recording, nor a folder, .zip or .tar.gz of these"
        )


def find_drives(path: Path) -> list[Source]:
    """Return the drives at a path, or in its folders.

    Raises:
        RecordingError: If there is a dataset without a readable description.
    """
    found = _within(path, _DEEPEST) if path.is_dir() else []
    return found or [Source(path)]


def _within(folder: Path, depth: int) -> list[Source]:
    if is_dataset(folder):
        return [Source(folder, episode) for episode in LerobotDataset(folder).episodes()]
    if is_tub(folder) or any(folder.glob("*.csv")):
        return [Source(folder)]
    if depth == 0:
        return []
    inner = sorted(each for each in folder.iterdir() if each.is_dir() and not each.is_symlink())
    return [
        found for each in inner if each.name[0] not in "._" for found in _within(each, depth - 1)
    ]


@contextlib.contextmanager
def unpacked(path: Path, scratch: Path, report: ImportReport) -> Iterator[Path]:
    """Unpack an archive into a folder that lasts as long as the context; else give the path itself.

    Args:
        path: A folder, a file, or an archive (.zip, .tar, .tar.gz, .tar.bz2).
        scratch: A folder with room for what is in it.
        report: What is damaged in the archive, or leads out of it, is skipped.

    Raises:
        RecordingError: If the archive cannot be read, or unpacks to more than 16 GB.
    """
    ending = next((e for e in _ENDINGS if path.name.lower().endswith(e)), None)
    if ending is None or not path.is_file():
        yield path
        return
    with tempfile.TemporaryDirectory(prefix=".import-", dir=scratch) as made:
        folder = Path(made) / path.name[: -len(ending)].strip(". ")
        folder.mkdir(exist_ok=True)
        unpack = _zip_entries if ending == ".zip" else _tar_entries
        try:
            _unpack(unpack(path), folder, report)
        except _DAMAGED as error:
            if not any(folder.iterdir()):
                raise RecordingError(f"{path} cannot be unpacked: {error}") from error
            report.skip(path.name, f"the archive is damaged or cut from here on: {error}")
        yield folder


def _zip_entries(path: Path) -> Iterator[Entry]:
    with zipfile.ZipFile(path) as archive:
        for info in archive.infolist():
            if not info.is_dir():
                yield info.filename, partial(archive.open, info)


def _tar_entries(path: Path) -> Iterator[Entry]:
    with tarfile.open(path) as archive:
        for info in archive:
            if info.isfile():
                yield info.name, partial(_opened, archive, info)


def _opened(archive: tarfile.TarFile, info: tarfile.TarInfo) -> IO[bytes]:
    file = archive.extractfile(info)
    assert file is not None, "only what is no file has no content"
    return file


def _unpack(entries: Iterator[Entry], folder: Path, report: ImportReport) -> None:
    left_bytes = _MOST_UNPACKED_BYTES
    for count, (name, open_entry) in enumerate(entries):
        parts = PurePosixPath(name.replace("\\", "/")).parts
        if count >= _MOST_FILES or left_bytes <= 0:
            raise RecordingError("the archive unpacks to more than 16 GB, or to too many files")
        if ".." in parts or parts[:1] == ("/",) or any(PureWindowsPath(p).drive for p in parts):
            report.skip(name[:80], "leads out of the archive")
            continue
        target = folder.joinpath(*parts)
        is_whole = False
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            with open_entry() as source, target.open("wb") as file:
                left_bytes -= _copy(source, file, left_bytes)
            is_whole = True
        except (zipfile.BadZipFile, zlib.error, RuntimeError, ValueError) as error:
            report.skip(name[:80], f"cannot be unpacked: {error}")
        finally:
            if not is_whole:
                target.unlink(missing_ok=True)


def _copy(source: Any, file: IO[bytes], most_bytes: int) -> int:
    copied = 0
    while copied <= most_bytes and (data := source.read(2**20)):
        file.write(data)
        copied += len(data)
    return copied
