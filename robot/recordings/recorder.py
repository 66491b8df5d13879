"""Records each run while it is driven. The loop only queues items; the disk's thread writes them.

A recording begins when the robot leaves `stopped` or the learner changes; it ends after the robot
has stood still for ten seconds. The queue for the disk is limited in items and in bytes, so a slow
disk costs the loop neither memory nor time. If the queue is full, new pictures are dropped and
counted. An example whose picture was dropped is recorded with its feature vector, so that no
example is lost.
"""

from __future__ import annotations

import contextlib
import secrets
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

from robot.control.loop import ControlLoop
from robot.control.state import Tick
from robot.errors import MissingExtraError
from robot.policy.events import HistoryEvent, Replaced, Taught, Undone
from robot.recordings.config import RecorderConfig
from robot.recordings.ending import end_cut_recordings
from robot.recordings.messages import Fields, Messages, Topic, describe_tick
from robot.recordings.open_recording import OpenRecording
from robot.recordings.reader import require_mcap
from robot.recordings.recorded_run import learner_of, run_of
from robot.recordings.writer import EpisodeWriter
from robot.store.disk import Announce, DiskThread, no_announcement
from robot.store.models.model import Model
from robot.types import Action, Frame, Mode

_KEPT_IDS = 512
"""Number of recorded pictures whose ids are remembered. If the picture of an example is not among
them, it is treated as not recorded."""


class RecordingQueue:
    """Receives items on the loop's thread, and writes them to a recording on the disk's thread.

    Attributes:
        lost: `OpenRecording.lost`.
        waiting_bytes: Bytes of queued pictures.
    """

    def __init__(self, recording: OpenRecording, config: RecorderConfig) -> None:
        self._recording = recording
        self._config = config
        self._lock = threading.Lock()
        self._jobs: deque[tuple[int, Callable[..., None], tuple[Any, ...]]] = deque()
        self._kept_ids: deque[int] = deque(maxlen=_KEPT_IDS)
        self.lost = recording.lost
        self.waiting_bytes = 0

    def begin(self, run: Mapping[str, str], model: Model | None) -> None:
        self._kept_ids.clear()
        self._put(0, self._recording.begin, run, model, self.lost.copy(), must_go=True)

    def end(self, model: Model | None, *, is_kept: bool) -> None:
        """End the recording; `model` is the learner's current state, None if unknown."""
        self._put(0, self._recording.end, model, is_kept, must_go=True)

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
        """Queue a picture that is not queued yet, or drop the picture if there is no room."""
        if frame.frame_id in self._kept_ids:
            return
        if self._put(len(frame.data), self._recording.write, EpisodeWriter.write_frame, frame):
            self._kept_ids.append(frame.frame_id)
        else:
            self.lost["frames"] += 1

    def write_messages(self, now_s: float, describe: Callable[[], Messages]) -> None:
        """Queue the messages that `describe` returns, all with the time `now_s`. If the queue is
        full, drop all of them. The disk's thread calls `describe`."""
        if not self._put(0, self._recording.write, _write_messages, now_s, describe):
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
            if waiting:
                self._recording.flush()
        except Exception as error:  # the thread must continue after any error
            with self._lock:
                self.waiting_bytes = sum(size for size, _, _ in self._jobs)
            self._recording.fail(error)


class Recorder:
    """Records the runs of one loop.

    `announce` is called when recording begins, ends, stops because of a fault, or loses pictures.
    `disk` is the thread that writes; by default the recorder starts a thread. `about` are the
    arguments `robot`, `declared_moves` and `options` of `describe_run`, which describe the robot in
    each recording.

    Attributes:
        recording: Writes the recording's files. If nothing is recorded, its `fault` says why.
        queue: The items that wait for the disk.
    """

    def __init__(
        self,
        loop: ControlLoop,
        folder: Path,
        *,
        announce: Announce = no_announcement,
        config: RecorderConfig | None = None,
        open_file: Callable[[Path], BinaryIO] = lambda path: path.open("xb"),
        disk: DiskThread | None = None,
        **about: Any,
    ) -> None:
        self._loop = loop
        self._config = config or RecorderConfig()
        self._folder = folder
        self.recording = OpenRecording(folder, self._config, open_file, announce, loop.clock)
        self.queue = RecordingQueue(self.recording, self._config)
        self._disk = disk or DiskThread(loop.clock)
        self._disk.add(self.queue.write_waiting)
        self._unsubscribe: Callable[[], None] = lambda: None
        self._about, self._run_id = about, secrets.token_hex(8)
        self._base: Model | None = None  # the learner when the next recording begins
        self._is_open = self._is_kept = False
        self._n_taught = 0  # examples in this recording, minus those that were undone
        self._mode = Mode.STOPPED
        self._moved_s = 0.0
        self._lead: deque[Frame] = deque(maxlen=self._config.lead_frames)

    def start(self) -> None:
        """Start recording. If the library `mcap` is missing, nothing is recorded and
        `recording.fault` says so."""
        try:
            require_mcap()
        except MissingExtraError as error:
            self.recording.refuse(str(error))
            return
        self._unsubscribe = self._loop.subscribe(self.note)
        self._disk.start()
        found = sorted(self._folder.glob("*.mcap"))
        clock = self._loop.clock
        clock.start_thread(lambda: end_cut_recordings(found, clock), "endings")

    def stop(self) -> None:
        """Finish the recording, preferably while the loop still runs; idempotent."""
        if self._is_open:
            with contextlib.suppress(TimeoutError):
                self._loop.clock.result(self._loop.submit(self._finish_for_good), 2.0)
        self._unsubscribe()
        # if the loop hangs, no tick ends the recording, so this thread does
        self.queue.end(None, is_kept=True)
        self._disk.stop()

    # On the loop's thread ----------------------------------------------------------------------

    def _finish_for_good(self) -> None:
        """Finish the recording. The loop calls this function after a tick, so that the recording
        contains the whole tick."""
        self._unsubscribe()
        self.finish()

    def note(self, tick: Tick) -> None:
        """Queue the data of one tick for recording."""
        if self._base is None and not self._is_open:
            self._base = learner_of(self._loop)
            return
        mode, now_s = tick.decision.mode, tick.now_s
        is_moving = mode is not Mode.STOPPED
        began = is_moving and self._mode is Mode.STOPPED
        self._moved_s = now_s if is_moving else self._moved_s
        events = self._own_events(tick.history_events)
        if began and self.recording.fault is not None:
            # the disk's thread ended the recording; the next one begins with these events
            if self._is_open:
                self.finish()
                events = ()
            self.recording.fault = None
        if not self._is_open and (is_moving or events):
            self.queue.begin(run_of(self._loop, self._run_id, now_s, self._about), self._base)
            self._is_open, self._is_kept, self._n_taught = True, False, 0
        is_over = self._is_over(tick, events)
        if self._is_open:
            self._record(tick, events)
        elif tick.frame is not None:
            self._remember(tick.frame)
        self._mode = mode
        if is_over:
            self.finish()

    def write_result(self, of: str, fields: Fields) -> None:
        """Add an extension's result to the current recording; drop it if there is no recording."""
        if self._is_open:
            now_s = self._loop.clock.now_s()
            result: Messages = [(Topic.RESULT, {"of": of, **fields})]
            self.queue.write_messages(now_s, lambda: result)

    def keep(self) -> None:
        """Keep the current recording even if the robot neither moved nor learned."""
        self._is_kept = True

    def finish(self) -> None:
        """End the recording, if one is open, with the learner's present state."""
        if self._is_open:
            self._base = learner_of(self._loop)
            self._end(self._base)

    def _end(self, final: Model | None) -> None:
        """End the recording, if one is open; `final` is the learner's state, None if unknown."""
        if self._is_open:
            self.queue.end(final, is_kept=self._is_kept)
            self._is_open = False

    def begin_anew(self) -> None:
        """Finish the current recording, and drop the pictures kept for the beginning of the
        next."""
        self.finish()
        self._lead.clear()

    def _own_events(self, events: tuple[HistoryEvent, ...]) -> tuple[HistoryEvent, ...]:
        """Return the events to record. If the policy was replaced, close the recording and return
        no events."""
        if any(isinstance(event, Replaced) for event in events):
            self._end(None)
            self._base = learner_of(self._loop)
            return ()
        return events

    def _record(self, tick: Tick, events: tuple[HistoryEvent, ...]) -> None:
        frames: list[Frame] = []
        if tick.frame is not None:
            if tick.now_s - self._moved_s <= self._config.trail_s:
                # a command of the pilot can label a picture that was recorded earlier
                frames = [*self._lead, tick.frame]
                self._lead.clear()
            else:
                self._remember(tick.frame)
        is_begun = tick.decision.mode is not self._mode
        if frames or is_begun or events or tick.decision.mode is not Mode.STOPPED:
            self.queue.write_tick(tick, frames, events, is_shown=bool(frames), is_begun=is_begun)
        is_drive = tick.sent != Action.STOP and self._config.keeps_drives
        self._is_kept |= is_drive or bool(events)

    def _remember(self, frame: Frame) -> None:
        self._lead.append(frame)
        while sum(len(frame.data) for frame in self._lead) > self._config.queue_bytes // 4:
            # large pictures would fill the queue, so drop the oldest picture
            self._lead.popleft()

    def _is_over(self, tick: Tick, events: tuple[HistoryEvent, ...]) -> bool:
        """True if the recording must end: after a pause, and when an undo removed examples of an
        earlier recording."""
        for event in events:
            self._n_taught += isinstance(event, Taught)
            if isinstance(event, Undone):
                self._n_taught -= len(event.frame_ids)
        reached_back = self._n_taught < 0  # the undo removed examples of an earlier recording
        is_pause = tick.now_s - self._moved_s >= self._config.pause_s and not events
        return reached_back or is_pause


def _write_messages(writer: EpisodeWriter, now_s: float, describe: Callable[[], Messages]) -> None:
    for topic, fields in describe():
        writer.write_message(topic, now_s, fields)
