"""Video for many viewers: each frame is encoded once, and slow viewers skip frames."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property

from robot.clock import Clock
from robot.devices.encoders import jpeg_encoder
from robot.errors import MissingExtraError
from robot.policy.image import Pixels, to_rgb
from robot.types import Encoding, Frame
from server.clients.flow_control import PictureSize, VideoWindow
from server.protocol import encode_picture

_REMEMBERED_FRAMES = 256
"""Number of frames whose capture time is remembered."""
_FREQUENT_S = 0.06
"""If frames come at longer intervals than this (in seconds), each of them requests an
acknowledgement, so that the server soon notices if the pilot sees nothing."""

_SELDOM_S, _EARLY_SHARE = 0.25, 0.95
"""A robot that stands still may rest if every viewer's interval exceeds `_SELDOM_S` seconds.
A frame may be sent after `_EARLY_SHARE` of the interval, because camera rates vary."""


class Encoder:
    """Encodes a frame as the message that all viewers get.

    JPEG and YUYV frames are sent unchanged. RGB frames, for example from a Pi's camera, are
    compressed if OpenCV is installed, and otherwise sent unchanged.
    """

    def __init__(self, jpeg_quality: int) -> None:
        self._quality = jpeg_quality
        self._last: tuple[Frame, bytes] | None = None

    @cached_property
    def _compress(self) -> Callable[[Pixels], bytes] | None:
        """OpenCV's encoder, imported at the first use; None if OpenCV is not installed."""
        try:
            return jpeg_encoder(self._quality)
        except MissingExtraError:
            return None

    def encode(self, frame: Frame) -> Frame:
        if frame.encoding is Encoding.RGB and self._compress is not None:
            return replace(frame, encoding=Encoding.JPEG, data=self.encode_jpeg(frame))
        return frame

    def encode_jpeg(self, frame: Frame) -> bytes:
        """Return the frame as JPEG; raises MissingExtraError if OpenCV is needed but missing."""
        if frame.encoding is Encoding.JPEG:
            return frame.data
        if self._compress is None:
            raise MissingExtraError("converting this camera's pictures to JPEG", "camera")
        if self._last is None or self._last[0] is not frame:
            self._last = frame, self._compress(to_rgb(frame))
        return self._last[1]


@dataclass(eq=False)
class Viewer:
    """One receiver of the video.

    Attributes:
        send: Sends a message without blocking, because the window of frames in flight is smaller
            than the buffer of the connection.
        every_s: The minimum time between two frames, in seconds.
        person: The name by which the limits count the viewer; see `Session.name`.
    """

    send: Callable[[bytes], None]
    every_s: float = 0.0
    person: str = ""
    drawn_id: int | None = None
    last_sent_id: int = 0
    last_sent_s: float = float("-inf")
    window: VideoWindow = field(default_factory=VideoWindow)
    size: PictureSize = field(default_factory=PictureSize)


class VideoHub:
    """Sends each viewer the newest frame as often as the viewer acknowledges frames.

    Everything runs on the server's event loop and nothing waits, so one viewer delays no other.

    `for_the_eye` returns a larger picture of a frame, or the frame itself if there is none. A
    viewer gets the larger pictures only if it draws pictures in time.
    """

    def __init__(
        self,
        encoder: Encoder,
        clock: Clock,
        for_the_eye: Callable[[Frame], Frame] = lambda frame: frame,
        on_viewers: Callable[[], None] = lambda: None,
    ) -> None:
        self.encoder = encoder
        self._on_viewers = on_viewers
        self._clock = clock
        self._for_the_eye = for_the_eye
        self._viewers: dict[Viewer, None] = {}
        self._watchers: list[Callable[[], None]] = []
        self.newest: Frame | None = None
        self._nonce = 0
        self._pictures: dict[bool, Frame] = {}
        self._messages: dict[tuple[bool, bool], bytes] = {}
        self.captured_s = OrderedDict[int, float]()  # of the last frames, by frame number
        self.frames_encoded = self.frames_sent = 0
        self.on_drawn: Callable[[float], None] = lambda age_s: None
        """Called when a viewer has drawn a frame, with the frame's age in seconds."""

    @property
    def viewers(self) -> int:
        return len(self._viewers) + len(self._watchers)

    @property
    def needed_every_s(self) -> float:
        """Interval of the pictures that viewers need, in s (0: every picture, inf: no viewers)."""
        if self._watchers:
            return 0.0
        every_s = min((viewer.every_s for viewer in self._viewers), default=math.inf)
        return every_s if every_s > _SELDOM_S else 0.0

    def add(self, viewer: Viewer) -> None:
        """Add a viewer, and send it the newest frame immediately."""
        self._viewers[viewer] = None
        self._on_viewers()
        self.offer(viewer, self._clock.now_s())

    def remove(self, viewer: Viewer) -> None:
        self._viewers.pop(viewer, None)
        self._on_viewers()
        if not self.viewers:
            self.newest = None  # too old for the next viewer

    def show(self, frame: Frame, nonce: int = 0) -> None:
        """Make `frame` the newest; send it with `nonce` to each viewer whose window has room."""
        self.newest, self._nonce = frame, nonce
        self._pictures, self._messages = {}, {}
        self.captured_s[frame.frame_id] = frame.captured_s
        if len(self.captured_s) > _REMEMBERED_FRAMES:
            self.captured_s.popitem(last=False)
        for watcher in list(self._watchers):
            watcher()
        now_s = self._clock.now_s()
        for viewer in list(self._viewers):
            self.offer(viewer, now_s)

    def offer(self, viewer: Viewer, now_s: float) -> None:
        """Send the newest frame, unless the viewer has the frame already or its window is full."""
        frame = self.newest
        if frame is None or frame.frame_id == viewer.last_sent_id:
            return
        if now_s - viewer.last_sent_s < _EARLY_SHARE * viewer.every_s:
            return
        window = viewer.window
        # A viewer with an interval shows many robots in small pictures, so the small size is sent.
        is_large = viewer.size.is_large and not viewer.every_s
        picture = self._pictures.get(is_large) or self._picture_of(frame, is_large)
        n_bytes = len(picture.data)
        if not window.may_send(n_bytes):
            return
        is_frequent = now_s - viewer.last_sent_s < _FREQUENT_S
        is_quiet = window.sent(frame.frame_id, n_bytes, now_s, is_frequent=is_frequent)
        viewer.last_sent_id, viewer.last_sent_s = frame.frame_id, now_s
        self.frames_sent += 1
        message = self._messages.get((is_large, is_quiet))
        if message is None:
            message = encode_picture(picture, self._nonce, is_quiet=is_quiet)
            self._messages[is_large, is_quiet] = message
        viewer.send(message)

    def _picture_of(self, frame: Frame, is_large: bool) -> Frame:
        """Return the newest frame's picture in one size; it is encoded once for all viewers."""
        if is_large not in self._pictures:
            source = self._for_the_eye(frame) if is_large else frame
            if is_large and source is frame:
                self._pictures[True] = self._picture_of(frame, False)
            else:
                self.frames_encoded += 1
                self._pictures[is_large] = self.encoder.encode(source)
        return self._pictures[is_large]

    def acknowledge(self, viewer: Viewer, frame_id: int, now_s: float) -> None:
        """Record that a viewer has drawn a frame, and send it a newer frame if there is one."""
        viewer.window.acknowledged(frame_id, now_s)
        viewer.drawn_id = frame_id
        viewer.size.note(viewer.window.delay_s or 0.0, now_s)
        captured_s = self.captured_s.get(frame_id)
        if captured_s is not None:
            self.on_drawn(now_s - captured_s)
        self.offer(viewer, now_s)

    def drawn_by(self, person: str) -> int | None:
        """Return the number of the newest frame that a person has seen; None if there is none."""
        own = (viewer for viewer in self._viewers if viewer.person == person)
        return max((one.drawn_id for one in own if one.drawn_id is not None), default=None)

    @contextmanager
    def watched(self, watcher: Callable[[], None]) -> Iterator[None]:
        """While the `with` block runs, count a viewer that reads `newest` by itself. `watcher`
        is called for each new frame, and must return quickly."""
        self._watchers.append(watcher)
        self._on_viewers()
        try:
            yield
        finally:
            self._watchers.remove(watcher)
            self._on_viewers()
