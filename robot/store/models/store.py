"""The models of one robot, by name. Each model is a folder of versions, so that at least one
version is always valid."""

from __future__ import annotations

import contextlib
import logging
import re
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

from robot.clock import RealClock
from robot.errors import NotFoundError, RecordingError, told_as
from robot.store.disk import Announce, no_announcement
from robot.store.folder import (
    Storage,
    check_name,
    free_name,
    paths_in,
    set_aside,
    write_whole,
)
from robot.store.models.model import (
    MAX_BYTES,
    JournalPosition,
    Model,
    ModelSummary,
    decode_model,
    decode_summary,
    encode_model,
    stamp,
)
from robot.store.models.trial import try_model
from robot.store.records import read_regular

_MACHINE = RealClock()
_T = TypeVar("_T")

log = logging.getLogger(__name__)

KEEP_VERSIONS = 3
"""Number of versions of a model that are kept, because the newest version may be damaged."""
_DAMAGED, _BROKEN = ".damaged", ".failed"
"""Endings of versions that were set aside because they were unreadable, or failed in use."""
_FAILED = "failed.txt"
_VERSION = re.compile(r"\d{1,9}\.npz", re.ASCII)
_ASIDE = re.compile(r"\.(damaged|failed)(-\d+)?$", re.ASCII)
_DAMAGED_VERSION = re.compile(r"\d{1,9}\.npz\.damaged(-\d+)?", re.ASCII)


class ModelStore:
    """All file operations on models. Safe for one writer and any number of readers."""

    def __init__(
        self,
        storage: Storage,
        wall_s: Callable[[], float] = _MACHINE.wall_s,
        announce: Announce = no_announcement,
    ) -> None:
        self._storage = storage
        self._announce = announce
        self._wall_s = wall_s
        self._markers = [storage.models / file for file in ("current.txt", "current.twin.txt")]

    def names(self) -> list[str]:
        """List the models: the folders that contain a version, readable or not.

        Folders that other programs create, such as `@eaDir` and `.stfolder`, are not listed.
        """
        found = [path for path in paths_in(self._storage.models) if not path.is_symlink()]
        return sorted((path.name for path in found if _is_model(path)), key=str.casefold)

    def summary(self, name: str) -> ModelSummary | None:
        """Return the summary of the newest readable version; None if there is none."""
        return next(self._sound(name, decode_summary), None)

    def aside(self, name: str) -> list[str]:
        """Return the names of the versions that were set aside."""
        return [path.name for path in self._files(name) if _ASIDE.search(path.name)]

    @property
    def current(self) -> str | None:
        """Name of the model that the robot used last. The next start uses this model."""
        said = [_marked(marker) for marker in self._markers]
        sound = [name for name, checksum in said if checksum == _checksum(name)]
        return next((name for name in sound if name in self.names()), None)

    @current.setter
    def current(self, name: str) -> None:
        for marker in self._markers:
            write_whole(marker, f"{name}\n{_checksum(name)}\n".encode())

    def save(self, name: str, model: Model) -> Path:
        if name not in self.names():  # the names of existing models are valid
            name = check_name(name)
        versions = self.versions(name)
        number = int(versions[-1].stem) + 1 if versions else 1
        path = self._storage.models / name / f"{number:05d}.npz"
        write_whole(path, encode_model(stamp(model, saved_at_s=self._wall_s())))
        for old in versions[: -(KEEP_VERSIONS - 1)]:
            with contextlib.suppress(OSError):
                old.unlink()
        return path

    def load(self, name: str) -> Model:
        """Read the newest valid version; damaged versions are renamed and stay on the disk."""
        for version in reversed(self.versions(self.require(name))):
            try:
                model = decode_model(_read(version))
                try_model(model)
            except RecordingError as error:
                self._set_aside(name, version, str(error))
            else:
                return model
        raise RecordingError(
            f"no version of the model {name!r} can be read; the damaged versions are kept in "
            f"{self._storage.models / name}"
        )

    def _set_aside(self, name: str, version: Path, why: str, ending: str = _DAMAGED) -> None:
        aside = set_aside(version, ending)
        log.warning("model %s: %s set aside as %s: %s", name, version.name, aside, why)
        self._announce("set_aside", detail=f"{name}/{version.name}: {why}"[:300])

    def retry_damaged(self) -> None:
        """Restore versions that were set aside as damaged but are readable by this program.

        An older program sets aside the versions that a newer program wrote. A version is restored
        as the newest of its model, unless the model has a later valid version. If a restored
        version is newer than the model in use, the robot uses the restored model next.
        """
        for name in self.names():
            for model, file in self._readable_again(name):
                if _age_of(model.summary) <= self._newest_age(name):
                    continue
                numbers = [int(version.stem) for version in self.versions(name)]
                number = max([int(file.name.partition(".")[0]), *(n + 1 for n in numbers[-1:])])
                in_use = self.current
                is_newest = in_use is None or _age_of(model.summary) > self._newest_age(in_use)
                with contextlib.suppress(OSError):
                    file.rename(file.with_name(f"{number:05d}.npz"))
                    log.info("model %s: %s can be read again as %05d.npz", name, file.name, number)
                    self._announce("put_back", detail=f"{name}/{number:05d}.npz")
                    if is_newest:
                        self.current = name

    def _readable_again(self, name: str) -> list[tuple[Model, Path]]:
        """Return the versions that were set aside as damaged but are readable, oldest first."""
        found = []
        for file in self._files(name):
            if _DAMAGED_VERSION.fullmatch(file.name):
                with contextlib.suppress(RecordingError, OSError):
                    model = decode_model(_read(file))
                    try_model(model)
                    found.append((model, file))
        return sorted(found, key=lambda one: _age_of(one[0].summary))

    def _newest_age(self, name: str) -> tuple[int, int, float]:
        """Return the greatest `_age_of` of a model's readable versions."""
        return max(map(_age_of, self._sound(name, decode_summary)), default=_age_of(None))

    def note_failure(self, name: str, why: str) -> None:
        """Record that a model failed. The next start sets the model's newest version aside."""
        write_whole(self._storage.models / self.require(name) / _FAILED, why.encode())

    def set_failed_aside(self) -> list[str]:
        """Set the newest version of each failed model aside; return the models' names."""
        failed = [n for n in self.names() if (self._storage.models / n / _FAILED).is_file()]
        for name in failed:
            mark, why = self._storage.models / name / _FAILED, "it failed while it drove"
            with contextlib.suppress(OSError):
                why = read_regular(mark, 4096).decode(errors="replace")
                mark.unlink()
            for version in self.versions(name)[-1:]:
                self._set_aside(name, version, why, _BROKEN)
        return failed

    def sound_versions(self, name: str) -> Iterator[Model]:
        """Yield the readable versions of a model, newest first; does not change any file."""
        return self._sound(name, decode_model)

    def _sound(self, name: str, decode: Callable[[bytes], _T]) -> Iterator[_T]:
        for version in reversed(self.versions(name)):
            with contextlib.suppress(RecordingError, OSError):
                yield decode(_read(version))

    def good_models(self) -> Iterator[tuple[str, Model]]:
        """Yield all readable models: first the model used last, then the others, newest first.

        The order is by journal position, or by the time of saving if there is no position.
        """
        current = self.current
        if current is not None:  # load the current model first; others are rarely needed
            with contextlib.suppress(RecordingError, NotFoundError):
                yield current, self.load(current)
        others = {name: _age_of(self.summary(name)) for name in self.names() if name != current}
        for name in sorted(others, key=others.__getitem__, reverse=True):
            with contextlib.suppress(RecordingError, NotFoundError):
                yield name, self.load(name)

    def read_file(self, name: str) -> bytes:
        for newest in self.versions(self.require(name))[-1:]:
            return _read(newest)
        raise RecordingError(f"the model {name!r} has no readable version")

    def add_file(self, name: str, data: bytes) -> str:
        """Save an uploaded model under this name, or a similar free name; return the name."""
        try_model(decode_model(data, max_bytes=len(data)))  # refuse a compressed model
        name = self.free_name(name)
        write_whole(self._storage.models / name / "00001.npz", data)
        return name

    def free_name(self, wanted: str) -> str:
        return free_name(check_name(wanted), {p.name for p in paths_in(self._storage.models)})

    def delete(self, name: str) -> str:
        """Move a model to the trash; return the key for `Storage.restore`."""
        return self._storage.discard(self._storage.models / self.require(name))

    def require(self, name: str) -> str:
        """Return the name; raises NotFoundError if there is no such model."""
        if name not in self.names():
            raise NotFoundError(f"unknown model {name[:80]!r}")
        return name

    def _files(self, name: str) -> list[Path]:
        return paths_in(self._storage.models / name)

    def versions(self, name: str) -> list[Path]:
        """List the versions, oldest first, including entries that are not files."""
        versions = [path for path in self._files(name) if _VERSION.fullmatch(path.name)]
        return sorted(versions, key=lambda path: int(path.stem))


def _is_model(folder: Path) -> bool:
    if folder.name.startswith(".") or not folder.is_dir():
        return False
    return any(_VERSION.match(path.name) for path in paths_in(folder))


def _age_of(summary: ModelSummary | None) -> tuple[int, int, float]:
    """Return a key that is greater for a later version, even if the clock was wrong."""
    if summary is None:
        return -1, 0, 0.0
    position = summary.position or JournalPosition(run="", boot=0, change=0)
    return position.boot, position.change, summary.saved_at_s


def _marked(marker: Path) -> tuple[str, str]:
    """Return a marker's model name and checksum. The checksum reveals a truncated name."""
    with contextlib.suppress(OSError, UnicodeDecodeError):
        name, _, checksum = read_regular(marker, 4096).decode().strip().partition("\n")
        return name, checksum
    return "", ""


def _checksum(name: str) -> str:
    return f"{zlib.crc32(name.encode()):08x}"


def _read(path: Path) -> bytes:
    with told_as(RecordingError, f"{path.name} cannot be read"):
        return read_regular(path, MAX_BYTES)
