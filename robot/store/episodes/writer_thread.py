"""Writes the recorder's queue to the disk on one thread; the queue is bounded."""

from __future__ import annotations

import logging
import shutil
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

from robot.clock import Clock, Worker
from robot.store.episodes.ending import end_cut_recordings
from robot.store.episodes.messages import Fields
from robot.store.episodes.writer import EpisodeWriter, Run
from robot.store.models.autosave import Announce
from robot.store.models.model import Model, encode_model
from robot.types import Frame

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class RecorderConfig:
    """Bounds of the queue and time limits."""

    queue_bytes: int = 32 * 2**20
    """Bytes of queued pictures; more are dropped and counted."""
    queue_items: int = 4096
    """Queued items of any kind; messages are small and are dropped last."""
    flush_every_s: float = 0.25
    """A kill loses at most so much."""
    pause_s: float = 10.0
    """A robot that stands for so long ends the recording."""
    trail_s: float = 1.0
    """Pictures go on for so long after the robot came to stand."""
    lead_frames: int = 15
    """Pictures from before the start that go along: the pilot may label them."""
    lead_bytes: int = 8 * 2**20
    spare_bytes: int = 64 * 2**20
    """Recording stops while the disk still has so much left: for models, and for the system."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lost:
    """Items dropped because the disk was too slow, counted from the program's start."""

    frames: int = 0
    messages: int = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Open:
    """Begin a recording, of a learner that knows `model`."""

    run: Run
    model: Model | None
    lost_before: Lost


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WriteMessage:
    """Write one message of a topic."""

    topic: str
    now_s: float
    fields: Fields


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Close:
    """End the recording; `model` is what the learner knows now, None if not known."""

    model: Model | None


Item = Open | WriteMessage | Close | Frame


class WriterThread:
    """One thread that writes the queued items."""

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
        self._queue: deque[tuple[Item, int]] = deque()
        self._waiting_bytes = 0
        self._wake = threading.Event()
        self._ending = False
        self._thread: Worker | None = None
        self._writer: EpisodeWriter | None = None
        self._flushed_s = 0.0
        self._checked_s = 0.0
        self._lost_before = Lost()
        self.lost = Lost()
        self.episode_id: str | None = None
        self.fault: str | None = None

    # Called on the loop's thread ---------------------------------------------------------------

    def put(self, item: Item, size: int) -> bool:
        """Queue an item; False if the queue is full. Never waits for the disk."""
        config = self._config
        with self._lock:
            is_full = self._waiting_bytes + size > config.queue_bytes and size > 0
            must_go = isinstance(item, Open | Close)
            if is_full or (len(self._queue) >= config.queue_items and not must_go):
                self._note_loss(item)
                return False
            self._queue.append((item, size))
            self._waiting_bytes += size
        if not self._wake.is_set():
            self._wake.set()
        return True

    def _note_loss(self, item: Item) -> None:
        is_frame = isinstance(item, Frame)
        lost = self.lost
        self.lost = Lost(frames=lost.frames + is_frame, messages=lost.messages + (not is_frame))

    def try_again(self) -> None:
        """Forget a fault of the disk: the robot starts again, and so may recording."""
        if self._thread is not None:
            self.fault = None

    @property
    def waiting_bytes(self) -> int:
        """Bytes of queued pictures."""
        return self._waiting_bytes

    # Life --------------------------------------------------------------------------------------

    def refuse(self, sentence: str) -> None:
        """Record nothing; `fault` is this sentence."""
        self.fault = sentence
        self._announce("recording_off", detail=sentence)

    def start(self) -> None:
        """Start the thread."""
        self._ending = False
        self._thread = self._clock.start_thread(self._run, "recorder")

    def stop(self) -> None:
        """Write what is queued, and end; gives up on a hanging disk after ten seconds."""
        if self._thread is not None:
            self._ending = True
            self._wake.set()
            self._thread.join(timeout=10.0)
            self._thread = None

    # On the recorder's thread --------------------------------------------------------------------

    def _run(self) -> None:
        end_cut_recordings(self._folder)
        while True:
            self._clock.wait(self._wake, self._config.flush_every_s)
            self._wake.clear()
            is_last = self._ending
            self._write_what_waits()
            if is_last:
                self._finish(None)
                return

    def _write_what_waits(self) -> None:
        try:
            while True:
                with self._lock:
                    if not self._queue:
                        break
                    item, size = self._queue.popleft()
                self._write(item)
                with self._lock:
                    self._waiting_bytes -= size
                self._flush_if_due()
            self._flush_if_due()
        except Exception as error:  # whatever it is, the thread must go on
            with self._lock:
                self._waiting_bytes = sum(size for _, size in self._queue)
            if isinstance(error, OSError):
                self._give_up(f"Recording stopped, the disk refused: {error.strerror or error}")
            else:
                log.exception("recording stopped")
                self._give_up(f"Recording stopped: {error}")

    def _write(self, item: Item) -> None:
        if isinstance(item, Open):
            self._finish(None)
            self._begin(item)
        elif self._writer is None:
            return
        elif isinstance(item, Frame):
            self._writer.write_frame(item)
        elif isinstance(item, WriteMessage):
            self._writer.write_message(item.topic, item.now_s, item.fields)
        else:
            self._finish(item.model)

    def _begin(self, item: Open) -> None:
        self._check_room()
        if self.fault is not None:
            return
        before = encode_model(item.model, is_packed=True) if item.model is not None else None
        run, file = self._open_free(item.run)
        self._writer = EpisodeWriter(file, run.describe(), before)
        self.episode_id = run.episode_id
        self._lost_before = item.lost_before
        self._announce("recording_on", episode=self.episode_id)

    def _open_free(self, run: Run) -> tuple[Run, BinaryIO]:
        """Open a file of the run's name; a clock that was set back may have given it before."""
        for number in range(1, 1000):
            episode_id = run.episode_id if number == 1 else f"{run.episode_id}-{number}"
            try:
                file = self._open_file(self._folder / f"{episode_id}.mcap")
            except FileExistsError:
                continue
            return replace(run, episode_id=episode_id), file
        raise OSError("there are too many recordings of the same moment")

    def _flush_if_due(self) -> None:
        now_s = self._clock.now_s()
        if self._writer is None or now_s - self._flushed_s < self._config.flush_every_s:
            return
        self._writer.flush()
        self._flushed_s = self._clock.now_s()
        if now_s - self._checked_s > 2.0:
            self._checked_s = now_s
            self._check_room()

    def _check_room(self) -> None:
        free = shutil.disk_usage(self._folder).free
        if free < self._config.spare_bytes:
            self._finish(None)
            self._give_up(f"Recording stopped: the disk has only {free >> 20} MB left.")

    def _finish(self, model: Model | None) -> None:
        writer, self._writer = self._writer, None
        if writer is None:
            return
        after = encode_model(model, is_packed=True) if model is not None else None
        frames = self.lost.frames - self._lost_before.frames
        messages = self.lost.messages - self._lost_before.messages
        summary = {"dropped_frames": str(frames), "lost_words": str(messages)}
        episode_id, self.episode_id = self.episode_id, None
        if not writer.has_content:
            writer.abandon()
            (self._folder / f"{episode_id}.mcap").unlink(missing_ok=True)
            self._announce("recording_done", episode=None)
            return
        try:
            writer.close(summary, after)
        finally:
            if frames or messages:
                self._announce("recording_lossy", dropped_frames=frames)
            self._announce("recording_done", episode=episode_id)

    def _give_up(self, sentence: str) -> None:
        """Stop recording until the robot starts again; it drives on."""
        writer, self._writer = self._writer, None
        if writer is not None:
            try:
                writer.abandon()
            except Exception as error:
                log.warning("closing the recording failed: %s", error)
        self.episode_id = None
        log.warning(sentence)
        self.refuse(sentence)
