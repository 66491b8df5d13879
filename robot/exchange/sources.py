"""Finds what can be imported at a path: in a folder, in folders within it, or in an archive."""

from __future__ import annotations

import contextlib
import errno
import stat
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path, PurePosixPath, PureWindowsPath
from tempfile import TemporaryDirectory
from typing import IO, NamedTuple

from robot.errors import RecordingError
from robot.exchange.drive import Drive, ImportReport
from robot.exchange.files import files_ending
from robot.exchange.folder import read_folder
from robot.exchange.lerobot_reader import LerobotDataset
from robot.exchange.npz import load_recording
from robot.exchange.tub import read_tub
from robot.exchange.tub_records import is_tub
from robot.store.folder import SCRATCH
from robot.store.lock import FolderLock

_DEEPEST = 5
_MOST_UNPACKED_BYTES = 16 * 2**30
_MOST_FILES = 2_000_000
_ENDINGS = (".zip", ".tar", ".tar.gz", ".tgz", ".tar.bz2")
_DAMAGED = (zipfile.BadZipFile, tarfile.TarError, zlib.error, EOFError, OSError, RuntimeError)
_OF_ONE = (zipfile.BadZipFile, zlib.error, RuntimeError, ValueError)
"""What spoils one file of an archive alone; so does a name that this system gives to no file."""
_NO_NAME = (errno.ENAMETOOLONG, errno.EEXIST, errno.ENOTDIR, errno.EISDIR, errno.EINVAL)
Entry = tuple[str, Callable[[], IO[bytes] | None]]


class Source(NamedTuple):
    """A drive that was found: what a person calls it, and what reads it.

    Reading takes the share of full lock beyond which a car turns. It raises RecordingError if
    nothing can be used, or MissingExtraError; pictures are read when the drive is written.
    """

    name: str
    read: Callable[[float, ImportReport], Drive]


def find_drives(path: Path) -> list[Source]:
    """Return the drives at a path, or in its folders; RecordingError if there is none that is
    known, or a dataset without a readable description."""
    if not path.is_dir() and path.suffix.lower() == ".npz":
        return [_recording(path)]
    if path.is_file() and path.suffix.lower() == ".csv":
        return [Source(path.name, partial(read_folder, path.parent, table=path))]
    found = _within(path, _DEEPEST) if path.is_dir() else []
    if not found:
        what = (
            "is neither a donkeycar tub, LeRobot dataset, CSV folder nor .npz, nor holds one "
            "(links to folders are not followed)"
        )
        raise RecordingError(f"{path} {what if path.exists() else 'does not exist'}")
    return found


def _within(folder: Path, depth: int) -> list[Source]:
    if (folder / "meta/info.json").is_file():
        dataset = LerobotDataset(folder)
        return [Source(f"{folder.name} {n}", partial(dataset.read, n)) for n in dataset.episodes()]
    if is_tub(folder):
        return [Source(folder.name, partial(read_tub, folder))]
    if files_ending(folder, ".csv"):
        return [Source(folder.name, partial(read_folder, folder))]
    found = [_recording(at) for at in files_ending(folder, ".npz") if not at.name.startswith("_")]
    inner = sorted(each for each in folder.iterdir() if each.is_dir() and not each.is_symlink())
    for each in inner if depth else ():
        found += _within(each, depth - 1) if each.name[0] not in "._" else []
    return found


def _recording(path: Path) -> Source:
    return Source(path.name, lambda _, report: load_recording(path, report))


@contextlib.contextmanager
def unpacked(path: Path, scratch: Path, report: ImportReport) -> Iterator[Path]:
    """Unpack an archive into a folder that lasts as long as the context; else give the path itself.

    `scratch` has room for what is in it. What is damaged, or leads out of the archive, is skipped;
    RecordingError if it cannot be read, or unpacks to more than 16 GB.
    """
    ending = next((e for e in _ENDINGS if path.name.lower().endswith(e)), None)
    if ending is None or not path.is_file():
        yield path
        return
    with TemporaryDirectory(prefix=SCRATCH, dir=scratch) as made, FolderLock(Path(made)):
        folder = Path(made) / path.name[: -len(ending)].strip(". ")
        folder.mkdir(exist_ok=True)
        entries = _zip_entries(path) if ending == ".zip" else _tar_entries(path)
        try:
            _unpack(entries, folder, report)
        except _DAMAGED as error:
            if not any(folder.iterdir()):
                raise RecordingError(f"{path} cannot be unpacked: {error}") from error
            report.skip(path.name, f"the archive is damaged or cut from here on: {error}")
        try:
            yield folder
        except RecordingError as error:  # nobody else knows that folder
            told = f"{error}".replace(str(folder), str(path))
            raise RecordingError(f"{told}{report.why_nothing()}") from error


def _zip_entries(path: Path) -> Iterator[Entry]:
    with zipfile.ZipFile(path) as archive:
        for info in archive.infolist():
            is_link = stat.S_ISLNK(info.external_attr >> 16)
            if not info.is_dir():
                yield info.filename, (lambda: None) if is_link else partial(archive.open, info)


def _tar_entries(path: Path) -> Iterator[Entry]:
    with tarfile.open(path) as archive:
        for info in archive:
            if not info.isdir():
                is_file = info.isfile()
                yield info.name, partial(archive.extractfile, info) if is_file else lambda: None


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
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            source = open_entry()
            if source is None:
                raise ValueError("it is a link: pack the files themselves, as tar -h does")
            with source, target.open("wb") as file:
                while left_bytes >= 0 and (data := source.read(2**20)):
                    left_bytes -= file.write(data)
        except BaseException as error:
            with contextlib.suppress(OSError):
                target.unlink()
            if not isinstance(error, _OF_ONE) and getattr(error, "errno", None) not in _NO_NAME:
                raise
            why = getattr(error, "strerror", None) or error
            report.skip(name[:80], f"cannot be unpacked: {why}")
