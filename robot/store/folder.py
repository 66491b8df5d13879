"""The data folder: its layout, and writing files atomically.

The folder's README.txt (`_readme`) and docs/reference/storage.md describe the layout.
"""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import re
import shutil
import time
import unicodedata
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from threading import get_native_id
from typing import BinaryIO
from uuid import uuid4

from robot.entry_points import points
from robot.errors import ConfigurationError, NotFoundError, reason
from robot.store.lock import FolderLock
from robot.store.presence import require_present

log = logging.getLogger(__name__)

_README = """\
Drivelesson stores here what robots were taught.

models/     one folder per model, versions as NumPy .npz files (no pickles): open with numpy.load
exports/    files exported for other programs
trash/      deleted files: move them back, or delete them for good
{folders}
You can copy and move all files while the program is not running.{secrets}
"""
FOLDERS = "drivelesson.folders"
"""Entry points of this group are instances of `FolderKind`: the folders of extensions."""

_HALF_DONE_S = 60.0
_LONGEST_NAME, _LONGEST_ENDING = 64, 40
"""Maximum lengths of a name (`check_name`), and of the ending that a file adds to it."""
_NAME = re.compile(rf"[^\W_][\w .()+,-]{{0,{_LONGEST_NAME - 1}}}", re.UNICODE)
_RESERVED = re.compile(r"(con|prn|aux|nul|(com|lpt)[\d¹²³]) *(\..*)?", re.IGNORECASE)
_KEY = re.compile(r"0\d{19}", re.ASCII)
SCRATCH = ".import-"
"""Prefix of the folders in the trash into which an import unpacks archives."""
_PART = re.compile(r"\..+\.\d+\.part", re.DOTALL)
"""Names of the temporary files of `whole_file`; other programs also write `.part` files."""
_BUSY = (5, 32)
"""Error numbers of Windows for a file that another program has open."""
_PAUSES_S = (0.01, 0.03, 0.1, 0.3, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class FolderKind:
    """An extension's folder in the data folder.

    Attributes:
        about: Lines for README.txt. Without lines the folder is created only when it is needed.
        reads: Matches the paths that the program reads in the folder; folders end with a slash.
        files: Names of the extension's files next to the folder.
        secrets: Names of the files and folders that only the owner may read.
        debris: Returns the unfinished files that a power cut may have left in the folder.
    """

    name: str
    about: str = ""
    reads: re.Pattern[str] | None = None
    files: tuple[str, ...] = ()
    secrets: tuple[str, ...] = ()
    debris: Callable[[Path], Iterable[Path]] = lambda folder: ()


@cache
def folder_kinds() -> tuple[FolderKind, ...]:
    """Return the folders of the installed extensions."""
    return tuple(point.load() for point in points(FOLDERS))


def _readme() -> str:
    kinds = folder_kinds()
    lines = [f"{kind.name + '/':12}{kind.about}\n" for kind in kinds if kind.about]
    secrets = ", ".join(secret for kind in kinds for secret in kind.secrets)
    keep = f" These are\nsecret, do not share them: {secrets}." if secrets else ""
    return _README.format(folders="".join(lines), secrets=keep)


def default_root() -> Path:
    """Return the default data folder: $DRIVELESSON_DATA if set, else the user\'s data folder."""
    if chosen := os.environ.get("DRIVELESSON_DATA"):
        return Path(chosen).expanduser()
    import platformdirs

    return Path(platformdirs.user_data_dir("drivelesson", appauthor=False))


def check_name(name: str) -> str:
    """Return a name given by a person, in a form that is also a valid file name. Raises
    ConfigurationError if the name could lead to another folder, or if some operating system could
    not store it."""
    tidy = composed(name).strip().rstrip(". ")
    if not _NAME.fullmatch(tidy) or _RESERVED.fullmatch(tidy) or len(tidy.encode()) > 200:
        raise ConfigurationError(
            f"{name[:80]!r} is not a valid name: use up to {_LONGEST_NAME} letters, digits, spaces "
            "and ( ) - + , . and begin with a letter or digit"
        )
    return tidy


def composed(name: str) -> str:
    """Return a name in Unicode's composed form (NFC): macOS may separate accents from letters."""
    return unicodedata.normalize("NFC", name)


def fold(name: str) -> str:
    """Return a key. Names that some file system cannot tell apart have the same key."""
    return composed(name).casefold()


def free_name(wanted: str, taken: set[str]) -> str:
    """Return `wanted`, or `wanted (2)` and so on: the first name that differs from all names
    in `taken` on every file system."""
    folded = set(map(fold, taken))
    candidate, number = wanted, 2
    while fold(candidate) in folded:
        ending = f" ({number})"
        candidate = wanted[: _LONGEST_NAME - len(ending)].rstrip() + ending
        number += 1
    return candidate


def write_whole(path: Path, data: bytes, *, mode: int = 0o666) -> None:
    """Write a file atomically; see `whole_file`."""
    with whole_file(path, mode=mode) as file:
        file.write(data)


@contextlib.contextmanager
def whole_file(path: Path, *, mode: int = 0o666) -> Iterator[BinaryIO]:
    """Open a temporary file. It atomically replaces `path` if the block ends without an exception.

    After a power cut, `path` is either the old file or the new file. If the disk fails (OSError),
    the old file stays. A missing folder is created. Use `mode` 0o600 for secrets.
    """
    require_present(path)
    is_new = not path.parent.exists()
    path.parent.mkdir(parents=True, exist_ok=True)
    # The name contains the thread's number, so that two writers never use the same file.
    temporary = path.with_name(f".{path.name}.{get_native_id()}.part")
    try:
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
        with os.fdopen(os.open(temporary, flags, mode), "wb") as file:
            yield file
            if not file.closed:
                file.flush()
                os.fsync(file.fileno())
        if path.is_dir() and not path.is_symlink():  # a folder cannot be replaced by a file
            set_aside(path)
        move(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
            if is_new:
                path.parent.rmdir()
        raise
    sync_folder(path.parent)


def move(path: Path, target: Path) -> None:
    """Rename atomically, and replace an existing target; raises OSError.

    On Windows, wait briefly for other programs that read the files, such as a virus scanner.
    """
    for pause_s in (*_PAUSES_S, None):
        try:
            path.replace(target)
            return
        except OSError as error:
            if pause_s is None or getattr(error, "winerror", None) not in _BUSY:
                raise
            time.sleep(pause_s)


def set_aside(path: Path, ending: str = ".set-aside") -> str:
    """Rename an unusable file, and return its new name; never raises OSError."""
    names = (f"{path.name}{ending}{more}" for more in ("", *(f"-{n}" for n in range(2, 1000))))
    return move_aside(path, map(path.with_name, names)).name


def move_aside(path: Path, targets: Iterable[Path]) -> Path:
    """Move a file or folder to the first target that is free, and return the target's path.

    A file that cannot be renamed stays in place. Never raises OSError.
    """
    target = next((place for place in targets if not os.path.lexists(place)), path)
    with contextlib.suppress(OSError):
        return path.rename(target)
    return path


def is_text(name: str) -> bool:
    """True if a file's name is valid UTF-8; other names can be neither shown nor sent."""
    return name == name.encode(errors="ignore").decode()


def paths_in(folder: Path) -> list[Path]:
    """List the entries of a folder whose names are UTF-8; empty if the folder is unreadable."""
    try:
        return sorted(path for path in folder.iterdir() if is_text(path.name))
    except OSError as error:
        if not isinstance(error, FileNotFoundError):
            log.warning("the folder %s cannot be read: %s", folder.name, error)
        return []


def size_of(path: Path) -> int:
    """Return the size of a file or folder in bytes; 0 if it does not exist."""
    try:
        return path.lstat().st_size
    except OSError:
        return 0


def sync_folder(folder: Path) -> None:
    """Flush the folder's directory entries to the disk, if this is supported."""
    if hasattr(os, "O_DIRECTORY"):
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(handle)
        except OSError as error:
            if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # a network or shared folder
                raise
        finally:
            os.close(handle)


def make_private(folder: Path) -> None:
    """Create a folder that only its owner can enter. If it exists, remove other users' rights.

    The folder contains pictures of a room, and secrets. If the folder belongs to another user, or
    the file system has no owners, nothing changes.
    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if hasattr(os, "getuid"):
        status = folder.stat()
        if status.st_uid == os.getuid() and status.st_mode & 0o077:
            with contextlib.suppress(OSError):
                folder.chmod(status.st_mode & 0o7700)


class Storage:
    """The data folder. Unless `creates` is False, the constructor creates it and its subfolders.

    Raises ConfigurationError if the folder cannot be written. If `must_be_usable` is False, the
    error is not raised but stored as `fault`, because a robot can also be driven without storage. A
    full disk does not count as a fault.
    """

    def __init__(self, root: Path, *, must_be_usable: bool = True, creates: bool = True) -> None:
        self.root = root.expanduser()
        self.models = self.root / "models"
        self.exports = self.root / "exports"
        self.trash = self.root / "trash"
        self.journal = self.root / "journal"
        self.fault: str | None = None
        if not creates:
            return
        try:
            make_private(self.root)
            for folder in self.kept():
                folder.mkdir(parents=True, exist_ok=True)
            if not (self.root / "README.txt").exists():
                write_whole(self.root / "README.txt", _readme().encode())
            if must_be_usable:
                self._try_longest()
            else:  # only check that files can be written
                write_whole(self.root / ".probe", b"")
                (self.root / ".probe").unlink(missing_ok=True)
        except OSError as error:
            if error.errno in (errno.ENOSPC, errno.EDQUOT):
                return  # not an error here, because the caller may be about to empty the trash
            if must_be_usable:
                raise ConfigurationError(
                    f"the data folder {self.root} cannot be used: {reason(error)}; "
                    "choose another with --data FOLDER"
                ) from error
            self.fault = f"{self.root}: {reason(error)}"

    def folder(self, name: str) -> Path:
        """Return an extension's folder."""
        return self.root / name

    def kept(self) -> list[Path]:
        """Return the folders for people: models, folders of extensions, exports, and trash."""
        own = [self.root / kind.name for kind in folder_kinds() if kind.about]
        return [self.models, *own, self.exports, self.trash]

    def _try_longest(self) -> None:
        """Create a file with the longest possible path; Windows allows only 260 characters."""
        # Use a new folder, because another program may do this at the same time.
        # Do not use `tempfile`: on Windows it retries endlessly if nothing can be written.
        folder = self.trash / uuid4().hex.ljust(_LONGEST_NAME, "n")
        try:
            folder.mkdir()
            (folder / ("n" * (_LONGEST_NAME + _LONGEST_ENDING))).touch()
        except OSError as error:
            if error.errno not in (errno.ENAMETOOLONG, errno.ENOENT, errno.EINVAL):
                raise
            n = len(str(self.trash.absolute())) + 2 + 2 * _LONGEST_NAME + _LONGEST_ENDING
            raise OSError(
                error.errno,
                f"it needs paths of up to {n} characters, which are too long for this system",
            ) from error
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def half_done(self) -> list[Path]:
        """List the unfinished files that a kill or a power cut left more than a minute ago.

        More recent files are not listed, because another program may still be writing them.
        """
        found: list[Path] = []
        with contextlib.suppress(OSError):
            kinds = folder_kinds()
            places = (self.root, *self.models.glob("*/"), *(self.root / k.name for k in kinds))
            parts = [p for at in places for p in at.glob(".*.part") if _PART.fullmatch(p.name)]
            for kind in kinds:
                parts += kind.debris(self.root / kind.name)
            for path in parts:
                with contextlib.suppress(OSError):
                    if time.time() - path.lstat().st_mtime > _HALF_DONE_S:
                        found.append(path)
        return found

    def sweep(self) -> None:
        """Remove the `half_done` files."""
        for path in self.half_done():
            with contextlib.suppress(OSError):
                path.unlink()

    def discard(self, *paths: Path) -> str:
        """Move files or folders to the trash together, and return the key for `restore`. On an
        OSError nothing is moved."""
        after = int(max(self.deleted(), default="0")) + 1  # the clock may have been set back
        key = f"{max(after, time.time_ns()):020d}"
        place = self.trash / key
        place.mkdir(parents=True)
        moved: list[Path] = []
        try:
            for path in paths:
                if path.exists():
                    move(path, place / path.name)
                    moved.append(path)
        except OSError:
            for path in moved:
                move(place / path.name, path)
            shutil.rmtree(place, ignore_errors=True)
            raise
        return key

    def deleted(self) -> list[str]:
        """Return the keys of the items in the trash, in the order of deletion."""
        return [path.name for path in paths_in(self.trash) if _KEY.fullmatch(path.name)]

    def restore(self, key: str, folder: Path, ending: str = "") -> list[str]:
        """Undo one deletion: of files with this ending, or of a folder if `ending` is empty.

        Returns the names without the ending. An item whose old name is in use gets a new name.
        Raises NotFoundError if the items are no longer in the trash or do not belong to `folder`.
        """
        place = self.trash / key
        if not _KEY.fullmatch(key) or not place.is_dir():
            raise NotFoundError("this deleted item is no longer in the trash")
        found = [
            p for p in paths_in(place) if p.name.endswith(ending) and p.is_file() == bool(ending)
        ]
        if not found:
            raise NotFoundError(f"this deleted item does not belong to the folder {folder.name}")
        taken = {path.name.removesuffix(ending) for path in paths_in(folder)}
        names: dict[str, str] = {}
        for old in (path.name.removesuffix(ending) for path in found):
            names[old] = free_name(old, taken)
            taken.add(names[old])
        for path in sorted(paths_in(place), key=found.__contains__):  # parts before recordings
            owners = [old for old in names if path.name == old or path.name.startswith(f"{old}.")]
            old = max(owners, key=len, default="")
            move(path, folder / (names.get(old, "") + path.name[len(old) :]))
        shutil.rmtree(place, ignore_errors=True)
        return list(names.values())

    def _ours_in_trash(self) -> list[Path]:
        """List deleted items and unpacked imports, but not the folders of other programs."""
        found = paths_in(self.trash)
        return [p for p in found if _KEY.fullmatch(p.name) or p.name.startswith(SCRATCH)]

    def trash_bytes(self) -> int:
        """Return the number of bytes that emptying the trash would free."""
        return sum(map(size_below, self._ours_in_trash()))

    def empty_trash(self) -> int:
        """Delete all items of the trash; return the bytes freed."""
        size = size_below(self.trash)
        for place in self._ours_in_trash():
            with contextlib.suppress(ConfigurationError):
                if place.name.startswith("."):
                    FolderLock(place).start()  # fails while an import is unpacking into this folder
                shutil.rmtree(place, ignore_errors=True)
        return size - size_below(self.trash)


def size_below(folder: Path) -> int:
    """Return the size of all files below a folder in bytes; unreadable files count as 0."""
    return sum(size_of(Path(at, name)) for at, _, names in os.walk(folder) for name in names)
