"""The one place on disk: what is kept, where, and how it gets there whole.

What stands where is in its README.txt, below, and in docs/reference/storage.md.
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
from robot.errors import ConfigurationError, NotFoundError
from robot.store.lock import FolderLock
from robot.store.presence import require_present

log = logging.getLogger(__name__)

_README = """\
Drivelesson keeps here what was taught.

models/     one folder a model, versions as NumPy .npz files (no pickles): open with numpy.load
exports/    what was made for other programs
trash/      what was deleted; move it back, or delete it for good
{folders}
All of it can be copied and moved while the program does not run.{secrets}
"""
FOLDERS = "drivelesson.folders"
"""Entry points of the folders that extensions have in the data folder: each a `FolderKind`."""

_HALF_DONE_S = 60.0
_LONGEST_NAME, _LONGEST_ENDING = 64, 40
"""Characters of a name (`check_name`), and of what is added to it in its folder."""
_NAME = re.compile(rf"[^\W_][\w .()+,-]{{0,{_LONGEST_NAME - 1}}}", re.UNICODE)
_RESERVED = re.compile(r"(con|prn|aux|nul|(com|lpt)[\d¹²³]) *(\..*)?", re.IGNORECASE)
_KEY = re.compile(r"0\d{19}", re.ASCII)
SCRATCH = ".import-"
"""How the folders begin in which an import unpacks, in the trash."""
_PART = re.compile(r"\..+\.\d+\.part", re.DOTALL)
"""What `whole_file` writes first: other programs have `.part` files of their own."""
_BUSY = (5, 32)
"""Windows' numbers for a file that another program has open."""
_PAUSES_S = (0.01, 0.03, 0.1, 0.3, 1.0)


def _no_debris(folder: Path) -> Iterable[Path]:
    return ()


@dataclass(frozen=True, slots=True, kw_only=True)
class FolderKind:
    """A folder that an extension has in the data folder.

    Attributes:
        about: What is in it, for README.txt, in lines; nothing: the folder is made when needed.
        reads: The names of the files that the program reads in it, however many there are.
        files: Files that the extension has beside it.
        secrets: Which of all that nobody else may see.
        debris: Returns what a power cut may have left half done in it.
    """

    name: str
    about: str = ""
    reads: re.Pattern[str] | None = None
    files: tuple[str, ...] = ()
    secrets: tuple[str, ...] = ()
    debris: Callable[[Path], Iterable[Path]] = _no_debris


@cache
def folder_kinds() -> tuple[FolderKind, ...]:
    """Return the folders of the installed extensions."""
    return tuple(point.load() for point in points(FOLDERS))


def _readme() -> str:
    kinds = folder_kinds()
    lines = [f"{kind.name + '/':12}{kind.about}\n" for kind in kinds if kind.about]
    secrets = ", ".join(secret for kind in kinds for secret in kind.secrets)
    keep = f" Keep these to\nyourself, they are secret: {secrets}." if secrets else ""
    return _README.format(folders="".join(lines), secrets=keep)


def default_root() -> Path:
    """Return where things are kept unless a person says otherwise.

    DRIVELESSON_DATA if it is set, else the user's data folder as the system has it.
    """
    chosen = os.environ.get("DRIVELESSON_DATA")
    if chosen:
        return Path(chosen).expanduser()
    import platformdirs

    return Path(platformdirs.user_data_dir("drivelesson", appauthor=False))


def check_name(name: str) -> str:
    """Return a person's name for a thing in the form in which it can also name a file;
    ConfigurationError if it could lead elsewhere, or some system could not store it."""
    tidy = composed(name).strip().rstrip(". ")
    if not _NAME.fullmatch(tidy) or _RESERVED.fullmatch(tidy) or len(tidy.encode()) > 200:
        raise ConfigurationError(
            f"{name[:80]!r} cannot be a name: use up to {_LONGEST_NAME} letters, digits, spaces "
            "and ( ) - + , . and begin with a letter or digit"
        )
    return tidy


def composed(name: str) -> str:
    """Return a name with each accent on its letter: macOS may write them apart."""
    return unicodedata.normalize("NFC", name)


def fold(name: str) -> str:
    """Return what is the same for names that a file system may mix up."""
    return composed(name).casefold()


def free_name(wanted: str, taken: set[str]) -> str:
    """Return `wanted`, or `wanted (2)` and so on, so that no file system mixes it up."""
    folded = set(map(fold, taken))
    candidate, number = wanted, 2
    while fold(candidate) in folded:
        ending = f" ({number})"
        candidate = wanted[: _LONGEST_NAME - len(ending)].rstrip() + ending
        number += 1
    return candidate


def write_whole(path: Path, data: bytes, *, mode: int = 0o666) -> None:
    """Put a file in its place all at once; see `whole_file`."""
    with whole_file(path, mode=mode) as file:
        file.write(data)


@contextlib.contextmanager
def whole_file(path: Path, *, mode: int = 0o666) -> Iterator[BinaryIO]:
    """Open a file that comes into its place all at once, where no exception ends the writing.

    After a power cut it is the old one or the new one; OSError if the disk refuses leaves the old
    one untouched. Its folder is made if there is none. `mode` 0o600 is for secrets.
    """
    require_present(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{get_native_id()}.part")  # two may write it at once
    try:
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
        with os.fdopen(os.open(temporary, flags, mode), "wb") as file:
            yield file
            if not file.closed:
                file.flush()
                os.fsync(file.fileno())
        if path.is_dir() and not path.is_symlink():  # somebody's, where the file belongs
            set_aside(path)
        move(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def move(path: Path, target: Path) -> None:
    """Rename in one step, over a file that may be there; raises OSError.

    On Windows another program that reads either, as virus scanners do, holds that up for a moment.
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
    """Give what cannot be used another name beside it, and return that; never raises OSError."""
    name = f"{path.name}{ending}"
    others = (f"{name}-{number}" for number in range(2, 1000))
    return move_aside(path, [path.with_name(one) for one in (name, *others)]).name


def move_aside(path: Path, targets: Iterable[Path]) -> Path:
    """Move what is in the way to the first of these places that is free; return where it is now.

    Where nothing can be renamed it stays; never raises OSError.
    """
    target = next((place for place in targets if not os.path.lexists(place)), path)
    with contextlib.suppress(OSError):
        return path.rename(target)
    return path


def is_text(name: str) -> bool:
    """True for a file's name that is UTF-8; others cannot be shown, nor sent."""
    return name == name.encode(errors="ignore").decode()


def paths_in(folder: Path) -> list[Path]:
    """List what stands in a folder under names that are text; nothing if it cannot be read."""
    try:
        return sorted(path for path in folder.iterdir() if is_text(path.name))
    except OSError as error:
        if not isinstance(error, FileNotFoundError):
            log.warning("the folder %s cannot be read: %s", folder.name, error)
        return []


def size_of(path: Path) -> int:
    """Return the bytes of what stands there, 0 if nothing does."""
    try:
        return path.lstat().st_size
    except OSError:
        return 0


def sync_folder(folder: Path) -> None:
    """Have the folder's list of names reach the disk, where the system can."""
    if hasattr(os, "O_DIRECTORY"):
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def make_private(folder: Path) -> None:
    """Make a folder that only its owner can enter, or take others' rights to one that is there.

    It holds pictures of a room, and secrets. A folder of another owner, or on a file system
    without owners, stays as it is.
    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if hasattr(os, "getuid"):
        status = folder.stat()
        if status.st_uid == os.getuid() and status.st_mode & 0o077:
            with contextlib.suppress(OSError):
                folder.chmod(status.st_mode & 0o7700)


class Storage:
    """The data folder. Making one makes the folder and what belongs in it.

    ConfigurationError if nothing can be written there. With `must_be_usable` False `fault` says so
    instead: for a server, which drives on without keeping anything. A full disk is no fault.
    """

    def __init__(self, root: Path, *, must_be_usable: bool = True) -> None:
        self.root = root.expanduser()
        self.models = self.root / "models"
        self.exports = self.root / "exports"
        self.trash = self.root / "trash"
        self.journal = self.root / "journal"
        self.fault: str | None = None
        try:
            make_private(self.root)
            for folder in self.kept():
                folder.mkdir(parents=True, exist_ok=True)
            if not (self.root / "README.txt").exists():
                write_whole(self.root / "README.txt", _readme().encode())
            if must_be_usable:
                self._try_longest()
            else:  # much can be kept where the trash takes nothing, or a long path is none
                write_whole(self.root / ".probe", b"")
                (self.root / ".probe").unlink(missing_ok=True)
        except OSError as error:
            if error.errno in (errno.ENOSPC, errno.EDQUOT):
                return  # the trash may be emptied
            if must_be_usable:
                raise ConfigurationError(
                    f"the data folder {self.root} cannot be used: {error.strerror or error}; "
                    "choose another with --data FOLDER"
                ) from error
            self.fault = f"{self.root}: {error.strerror or error}"

    def folder(self, name: str) -> Path:
        """Return the folder that an extension has here."""
        return self.root / name

    def kept(self) -> list[Path]:
        """Return the folders that a person may look into: models, those of extensions, trash."""
        own = [self.root / kind.name for kind in folder_kinds() if kind.about]
        return [self.models, *own, self.exports, self.trash]

    def _try_longest(self) -> None:
        """Make a file with a path as long as any to come: Windows takes 260 characters in all."""
        # A folder of its own: another program may be trying at the same time. On Windows `tempfile`
        # tries names for ever where nothing can be written.
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
                f"a file in it can need a path of {n} characters, which is too long here",
            ) from error
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def half_done(self) -> list[Path]:
        """List what a kill or a power cut left unfinished a minute ago or more.

        What is younger may be on its way just now, by another program.
        """
        found: list[Path] = []
        with contextlib.suppress(OSError):
            kinds = folder_kinds()
            places = (self.root, *self.models.glob("*/"), *(self.root / k.name for k in kinds))
            parts = [path for place in places for path in place.glob(".*.part")]
            parts = [path for path in parts if _PART.fullmatch(path.name)]
            for kind in kinds:
                parts += kind.debris(self.root / kind.name)
            for path in parts:
                with contextlib.suppress(OSError):
                    if time.time() - path.lstat().st_mtime > _HALF_DONE_S:
                        found.append(path)
        return found

    def sweep(self) -> None:
        """Remove what is `half_done`."""
        for path in self.half_done():
            with contextlib.suppress(OSError):
                path.unlink()

    def usage(self) -> dict[str, int]:
        """Return the bytes of what is kept and of the trash, and what the disk has left: `free`."""
        sizes, free = {folder.name: _size(folder) for folder in self.kept()}, 0
        with contextlib.suppress(OSError):
            free = shutil.disk_usage(self.root).free
        return {**sizes, "free": free}

    def discard(self, *paths: Path) -> str:
        """Move files or folders to the trash together; return the key for `restore`."""
        after = int(max(self.deleted(), default="0")) + 1  # the clock may have been set back
        key = f"{max(after, time.time_ns()):020d}"
        place = self.trash / key
        place.mkdir()
        for path in paths:
            if path.exists():
                move(path, place / path.name)
        return key

    def deleted(self) -> list[str]:
        """Return the keys of what is in the trash, in the order in which it was deleted."""
        return [path.name for path in paths_in(self.trash) if _KEY.fullmatch(path.name)]

    def restore(self, key: str, folder: Path, ending: str = "") -> str:
        """Move a deleted file with this ending back, or a folder; return its name without it.

        The name is a new one if the old one is in use. NotFoundError if it was restored or emptied,
        or is something else.
        """
        place = self.trash / key
        if not _KEY.fullmatch(key) or not place.is_dir():
            raise NotFoundError("that is no longer in the trash")
        found = [
            p for p in paths_in(place) if p.name.endswith(ending) and p.is_file() == bool(ending)
        ]
        if not found:
            raise NotFoundError(f"that is none of the {folder.name}")
        old = found[0].name.removesuffix(ending)
        new = free_name(old, {path.name.removesuffix(ending) for path in paths_in(folder)})
        for path in paths_in(place):
            move(path, folder / path.name.replace(old, new, 1))
        shutil.rmtree(place, ignore_errors=True)
        return new

    def _ours_in_trash(self) -> list[Path]:
        """List what was deleted, and what an import unpacks; other programs' folders are theirs."""
        found = paths_in(self.trash)
        return [p for p in found if _KEY.fullmatch(p.name) or p.name.startswith(SCRATCH)]

    def empty_trash(self) -> int:
        """Delete for good what is in the trash; return how many bytes that freed."""
        size = _size(self.trash)
        for place in self._ours_in_trash():
            with contextlib.suppress(ConfigurationError):
                if place.name.startswith("."):
                    FolderLock(place).start()  # refuses where an import unpacks just now
                shutil.rmtree(place, ignore_errors=True)
        return size - _size(self.trash)


def _size(folder: Path) -> int:
    """Count the bytes of all files below; what cannot be read counts nothing."""
    return sum(size_of(Path(at, name)) for at, _, names in os.walk(folder) for name in names)
