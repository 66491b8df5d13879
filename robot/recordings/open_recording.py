"""The recording that is being written. One thread, the `DiskThread`, does all writing to its files.

A long recording continues in further files. Recording stops if writing fails or the disk is almost
full; the robot drives on.
"""

from __future__ import annotations

import contextlib
import logging
import shutil
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, BinaryIO

from robot.clock import Clock
from robot.errors import reason
from robot.recordings.config import RecorderConfig
from robot.recordings.messages import CONTINUES
from robot.recordings.parts import part_path, parts_folder
from robot.recordings.writer import EpisodeWriter, describe_part
from robot.store.disk import Announce
from robot.store.folder import free_name, paths_in, sync_folder
from robot.store.models.model import Model, encode_model
from robot.store.presence import require_present

log = logging.getLogger(__name__)


class OpenRecording:
    """Writes recordings to a folder, one after the other.

    Attributes:
        episode_id: Name of the recording that is being written, if there is one.
        fault: The reason why nothing is recorded, as a sentence; None if there is no fault.
        lost: Numbers of `frames` and `messages` that were dropped since the program began, because
            the disk was too slow.
    """

    def __init__(
        self,
        folder: Path,
        config: RecorderConfig,
        open_file: Callable[[Path], BinaryIO],
        announce: Announce,
        clock: Clock,
    ) -> None:
        self.episode_id: str | None = None
        self.fault: str | None = None
        self.lost: Counter[str] = Counter()
        self._folder = folder
        self._config = config
        self._open_file = open_file
        self._announce = announce
        self._clock = clock
        self._writer: EpisodeWriter | None = None
        self._run: Mapping[str, str] = {}
        self._part, self._part_began_s = 0, 0.0
        self._checked_s = 0.0
        self._lost_before: Counter[str] = Counter()

    def begin(self, run: Mapping[str, str], model: Model | None, lost_before: Counter[str]) -> None:
        """Begin a recording of this run, unless recording was refused."""
        self.end()
        require_present(self._folder)
        self._check_room()
        if self.fault is not None:
            return
        before = encode_model(model, is_packed=True) if model is not None else None
        # If the clock was set back, this name may already be used.
        episode_id = free_name(run["episode"], {path.stem for path in paths_in(self._folder)})
        path = self._folder / f"{episode_id}.mcap"
        self._run = {**run, "episode": episode_id}
        self._writer = self._begin_file(path, self._run, model_before=before)
        self._part, self._part_began_s = 0, self._clock.now_s()
        self.episode_id = episode_id
        self._lost_before = lost_before
        self._announce("recording_on", episode=self.episode_id)

    def write(self, write: Callable[..., None], *what: Any) -> None:
        """Call `write(writer, *what)` with the file's writer, if a recording is open."""
        if self._writer is not None:
            write(self._writer, *what)
            lasted_s = self._clock.now_s() - self._part_began_s
            if (
                self._writer.bytes_written >= self._config.part_bytes
                or lasted_s >= self._config.part_s
            ):
                self._writer = self._next_part(self._writer)

    def flush(self) -> None:
        """Flush the file; end the recording if the disk is almost full."""
        if self._writer is not None:
            self._writer.flush()
            if self._clock.now_s() - self._checked_s > 2.0:
                self._check_room()

    def end(self, model: Model | None = None, is_kept: bool = True) -> None:
        """Complete the recording, or discard it. `model` is the learner's state at the end of
        the recording; None if the state is unknown."""
        writer, self._writer = self._writer, None
        if writer is None:
            return
        episode_id, self.episode_id = self.episode_id, None
        if not is_kept:
            writer.abandon()
            path = self._folder / f"{episode_id}.mcap"
            path.unlink(missing_ok=True)
            shutil.rmtree(parts_folder(path), ignore_errors=True)
            self._announce("recording_done", episode=None)
            return
        after = encode_model(model, is_packed=True) if model is not None else None
        lost = self.lost - self._lost_before
        try:
            writer.close(self._losses(), after)
        finally:
            if lost:
                self._announce("recording_lossy", dropped_frames=lost["frames"])
            self._announce("recording_done", episode=episode_id)

    def fail(self, error: Exception) -> None:
        """End the recording because of an error, and report the error."""
        if isinstance(error, OSError):
            self._give_up(f"Recording stopped because writing failed: {reason(error)}")
        else:
            log.exception("recording stopped")
            self._give_up(f"Recording stopped: {error}")

    def refuse(self, sentence: str) -> None:
        """Stop recording, and set `fault` to this sentence."""
        self.fault = sentence
        self._announce("recording_off", detail=sentence)

    def _next_part(self, writer: EpisodeWriter) -> EpisodeWriter:
        """Complete the file, then continue the recording in another."""
        writer.close({CONTINUES: "1", **self._losses()})
        self._part, self._part_began_s = self._part + 1, self._clock.now_s()
        path = self._folder / f"{self.episode_id}.mcap"
        require_present(self._folder)
        parts_folder(path).mkdir(exist_ok=True)
        tally = writer.tally.next()
        run = describe_part(self._run, self._part, tally)
        return self._begin_file(part_path(path, self._part), run, tally=tally)

    def _begin_file(self, path: Path, run: Mapping[str, str], **more: Any) -> EpisodeWriter:
        """Begin to write a file; close it if that fails."""
        file = self._open_file(path)
        try:
            for folder in {path.parent, self._folder}:
                sync_folder(folder)
            return EpisodeWriter(file, run, **more)
        except Exception:
            with contextlib.suppress(OSError):  # the buffered bytes cannot be written either
                file.close()
            raise

    def _losses(self) -> dict[str, str]:
        lost = self.lost - self._lost_before
        return {"dropped_frames": str(lost["frames"]), "lost_words": str(lost["messages"])}

    def _check_room(self) -> None:
        self._checked_s = self._clock.now_s()
        free = shutil.disk_usage(self._folder).free
        if free < self._config.spare_bytes:
            self.end()
            self._give_up(f"Recording stopped: the disk has only {free >> 20} MB left.")

    def _give_up(self, sentence: str) -> None:
        """Stop recording because of a fault. The robot drives on. Recording is tried again when the
        robot has stopped and starts to drive again."""
        writer, self._writer = self._writer, None
        if writer is not None:
            with contextlib.suppress(Exception):  # the disk has already failed
                writer.abandon()
        self.episode_id = None
        log.warning(sentence)
        self.refuse(sentence)
