"""Unpacks archives that other programs made, up to a maximum size and number of files."""

from __future__ import annotations

import contextlib
import errno
import lzma
import stat
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path, PurePosixPath, PureWindowsPath
from tempfile import TemporaryDirectory
from typing import IO

from robot.errors import RecordingError, reason
from robot.exchange.drive import ImportReport
from robot.store.folder import SCRATCH
from robot.store.lock import FolderLock

_MOST_UNPACKED_BYTES = 16 * 2**30
_MOST_FILES = 2_000_000
_ZIPS = (".zip", ".tm")
"""Endings of zip archives. A project of Teachable Machine (`.tm`) is also a zip archive."""
ENDINGS = (*_ZIPS, ".tar", ".tar.gz", ".tgz", ".tar.bz2", ".tbz2", ".tar.xz", ".txz")
_DAMAGED = (
    *(zipfile.BadZipFile, tarfile.TarError, zlib.error, lzma.LZMAError),
    *(EOFError, OSError, RuntimeError),
)
_BAD_FILE = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, RuntimeError, ValueError)
"""After one of these errors, only the affected file of an archive is skipped. A file whose name the
system rejects (`_NO_NAME`) is skipped, too."""
_NO_NAME = (errno.ENAMETOOLONG, errno.EEXIST, errno.ENOTDIR, errno.EISDIR, errno.EINVAL)
Entry = tuple[str, Callable[[], IO[bytes] | None]]


@contextlib.contextmanager
def unpacked(path: Path, scratch: Path, report: ImportReport) -> Iterator[Path]:
    """Unpack an archive for the duration of the context and yield the folder; if `path` is not an
    archive, yield `path`.

    `scratch` is a folder on a disk with room for the content. Files that are damaged, or whose
    paths lead out of the archive, are skipped. Raises RecordingError if the archive cannot be read,
    or unpacks to more than 16 GB.
    """
    ending = next((e for e in ENDINGS if path.name.lower().endswith(e)), None)
    if ending is None or not path.is_file():
        yield path
        return
    with TemporaryDirectory(prefix=SCRATCH, dir=scratch) as made, FolderLock(Path(made)):
        folder = Path(made) / path.name[: -len(ending)].strip(". ")
        folder.mkdir(exist_ok=True)
        entries = _zip_entries(path) if ending in _ZIPS else _tar_entries(path)
        try:
            _unpack(entries, folder, report)
        except _DAMAGED as error:
            if not any(folder.iterdir()):
                raise RecordingError(f"{path} cannot be unpacked: {error}") from error
            report.skip(path.name, f"the rest of the archive is damaged or missing: {error}")
        try:
            yield folder
        except RecordingError as error:
            # the message names the archive, not the temporary folder
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
            raise RecordingError("the archive unpacks to more than 16 GB or 2,000,000 files")
        if ".." in parts or parts[:1] == ("/",) or any(PureWindowsPath(p).drive for p in parts):
            report.skip(name[:80], "the path leads out of the archive")
            continue
        target = folder.joinpath(*parts)
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            source = open_entry()
            if source is None:
                raise ValueError("the entry is a link: pack the file instead, as tar -h does")
            with source, target.open("wb") as file:
                while left_bytes >= 0 and (data := source.read(2**20)):
                    left_bytes -= file.write(data)
        except BaseException as error:
            with contextlib.suppress(OSError):
                target.unlink()
            if not isinstance(error, _BAD_FILE) and getattr(error, "errno", None) not in _NO_NAME:
                raise
            report.skip(name[:80], f"cannot be unpacked: {reason(error)}")
