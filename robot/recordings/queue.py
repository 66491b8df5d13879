"""A bounded queue of items to record, and the file to which the items are written."""

from __future__ import annotations

import contextlib
import logging
import shutil
import threading
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

from robot.clock import Clock
from robot.control.state import Tick
from robot.policy.history import HistoryEvent, Taught
from robot.recordings.messages import CONTINUES, Messages, describe_tick
from robot.recordings.parts import part_path, parts_folder
from robot.recordings.writer import EpisodeWriter, describe_part
from robot.store.disk import Announce
from robot.store.folder import free_name, paths_in, sync_folder
from robot.store.models.model import Model, encode_model
from robot.store.presence import require_present
from robot.types import Frame

log = logging.getLogger(__name__)
_KEPT_IDS = 512
"""An example's picture is looked up among this number of the latest recorded pictures."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecorderConfig:
    """Bounds of the queue, time limits, and which recordings to keep."""

    keeps_drives: bool = True
    """True: keep recordings in which the robot moved but was not taught."""

    queue_bytes: int = 32 * 2**20
    """Most bytes of queued pictures; further pictures are dropped and counted."""
    queue_items: int = 4096
    """Most queued items. A picture is one item, and so are the messages of one tick together.
    Messages are dropped last, because they are small."""
    pause_s: float = 10.0
    """Time for which the robot must stand still before the recording ends, in seconds."""
    trail_s: float = 1.0
    """Time for which pictures are still recorded after the robot stopped, in seconds."""
    lead_frames: int = 15
    """Number of pictures from before the start that are also recorded, because the pilot may label
    them. These pictures fill at most a quarter of the queue."""
    part_bytes: int = 64 * 2**20
    """Size at which a recording continues in another file, in bytes."""
    part_s: float = 600.0
    """Time after which a recording continues in another file, in seconds. This limits the memory
    that the recorder needs, and a reader if a file has no index."""
    spare_bytes: int = 64 * 2**20
    """Recording stops if fewer bytes are free on the disk. These bytes are left for models and the
    system."""


class RecordingQueue:
    """Receives items on the loop's thread, and writes them on the disk's thread."""

    def __init__(
        self,
        folder: Path,
        config: RecorderConfig,
        open_file: Callable[[Path], BinaryIO],
        announce: Announce,
        clock: Clock,
    ) -> None:
        self._folder = folder
        self._config = config
        self._open_file = open_file
        self._announce = announce
        self._clock = clock
        self._lock = threading.Lock()
        self._jobs: deque[tuple[int, Callable[..., None], tuple[Any, ...]]] = deque()
        self._kept_ids: deque[int] = deque(maxlen=_KEPT_IDS)
        self._writer: EpisodeWriter | None = None
        self._run: Mapping[str, str] = {}
        self._part, self._part_began_s = 0, 0.0
        self._checked_s = 0.0
        self._lost_before: Counter[str] = Counter()
        self.waiting_bytes = 0
        """Bytes of queued pictures."""
        self.lost: Counter[str] = Counter()
        """Numbers of `frames` and `messages` that were dropped since the program began, because the
        disk was too slow."""
        self.episode_id: str | None = None
        self.fault: str | None = None

    # Called on the loop's thread ---------------------------------------------------------------

    def begin(self, run: Mapping[str, str], model: Model | None) -> None:
        self._kept_ids.clear()
        self._put(0, self._begin, run, model, self.lost.copy(), must_go=True)

    def end(self, model: Model | None, *, is_kept: bool) -> None:
        """End the recording; `model` is the learner's current state, None if unknown."""
        self._put(0, self._end, model, is_kept, must_go=True)

    def write_tick(
        self, tick: Tick, frames: Sequence[Frame], events: Sequence[HistoryEvent], **shown: bool
    ) -> None:
        """Queue pictures and the messages of a tick; `shown` is passed to `describe_tick`."""
        for frame in frames:
            self.write_frame(frame)
        taught = [event.example.frame_id for event in events if isinstance(event, Taught)]
        lost = [frame_id for frame_id in taught if frame_id not in self._kept_ids]
        bare = replace(tick, frame=None)  # dropped pictures must not use memory
        self.write_messages(tick.now_s, partial(describe_tick, bare, events, lost, **shown))

    def write_frame(self, frame: Frame) -> None:
        """Queue a picture once, or drop it if there is no room."""
        if frame.frame_id in self._kept_ids:
            return
        if self._put(len(frame.data), self._write, EpisodeWriter.write_frame, frame):
            self._kept_ids.append(frame.frame_id)
        else:
            self.lost["frames"] += 1

    def write_messages(self, now_s: float, describe: Callable[[], Messages]) -> None:
        """Queue messages of one time, or drop them all if there is no room. The disk's thread calls
        `describe`."""
        if not self._put(0, self._write, _write_messages, now_s, describe):
            self.lost["messages"] += len(describe())

    def _put(self, size: int, job: Callable[..., None], *what: Any, must_go: bool = False) -> bool:
        """Queue a job; return False if the queue is full. Never waits for the disk."""
        config = self._config
        with self._lock:
            is_full = self.waiting_bytes + size > config.queue_bytes and size > 0
            if is_full or (len(self._jobs) >= config.queue_items and not must_go):
                return False
            self._jobs.append((size, job, what))
            self.waiting_bytes += size
        return True

    def refuse(self, sentence: str) -> None:
        """Stop recording, and set `fault` to this sentence."""
        self.fault = sentence
        self._announce("recording_off", detail=sentence)

    def resume(self) -> None:
        """Record again from the next start, because the cause of `fault` is gone."""
        self.fault = None

    # On the disk's thread ------------------------------------------------------------------------

    def write_waiting(self) -> None:
        """Write the queued items to the disk, and flush. Never raises: a failure ends the
        recording."""
        try:
            waiting = len(self._jobs)
            for _ in range(waiting):
                with self._lock:
                    size, job, what = self._jobs.popleft()
                job(*what)
                with self._lock:
                    self.waiting_bytes -= size
            if self._writer is not None and waiting:
                self._writer.flush()
                if self._clock.now_s() - self._checked_s > 2.0:
                    self._check_room()
        except Exception as error:  # the thread must continue after any error
            with self._lock:
                self.waiting_bytes = sum(size for size, _, _ in self._jobs)
            if isinstance(error, OSError):
                self._give_up(f"Recording stopped, writing failed: {error.strerror or error}")
            else:
                log.exception("recording stopped")
                self._give_up(f"Recording stopped: {error}")

    def _write(self, write: Callable[..., None], *what: Any) -> None:
        if self._writer is not None:
            write(self._writer, *what)
            lasted_s = self._clock.now_s() - self._part_began_s
            if (
                self._writer.bytes_written >= self._config.part_bytes
                or lasted_s >= self._config.part_s
            ):
                self._writer = self._next_part(self._writer)

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

    def _losses(self) -> dict[str, str]:
        lost = self.lost - self._lost_before
        return {"dropped_frames": str(lost["frames"]), "lost_words": str(lost["messages"])}

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

    def _begin(
        self, run: Mapping[str, str], model: Model | None, lost_before: Counter[str]
    ) -> None:
        self._end()
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

    def _check_room(self) -> None:
        self._checked_s = self._clock.now_s()
        free = shutil.disk_usage(self._folder).free
        if free < self._config.spare_bytes:
            self._end()
            self._give_up(f"Recording stopped: the disk has only {free >> 20} MB left.")

    def _end(self, model: Model | None = None, is_kept: bool = True) -> None:
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

    def _give_up(self, sentence: str) -> None:
        """Stop recording until the robot starts again; the robot continues to drive."""
        writer, self._writer = self._writer, None
        if writer is not None:
            with contextlib.suppress(Exception):  # the disk has already failed
                writer.abandon()
        self.episode_id = None
        log.warning(sentence)
        self.refuse(sentence)


def _write_messages(writer: EpisodeWriter, now_s: float, describe: Callable[[], Messages]) -> None:
    for topic, fields in describe():
        writer.write_message(topic, now_s, fields)
