"""Decides how many frames may be in flight to a viewer, and how large they may be.

Pure: nothing here uses sockets or clocks; the time is an argument.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from typing import NamedTuple

from server.protocol import ErrorCode, ProtocolError


class _Sent(NamedTuple):
    at_s: float
    size: int
    in_flight: int
    is_quiet: bool


class VideoWindow:
    """A congestion window: the number of frames that may be in flight to one viewer.

    If bandwidth is the limit, the window is one frame, because a second frame would only queue
    behind the first. If only latency is the limit, more frames in flight do no harm, and the window
    may grow to `LARGEST` frames. To test which limit applies, the window grows by one frame
    whenever a frame had to be skipped. If acknowledgements then come later than before, the window
    shrinks to one frame, and the next attempt waits four times as long as the previous one.

    On a fast link, acknowledgements arrive long before the next frame. Then only every third frame
    requests an acknowledgement; the others are *quiet*. Quiet frames save server and phone a third
    of their work, and the phone sends one packet instead of three.
    """

    LARGEST = 4
    LARGEST_BYTES = 60_000
    """Maximum number of bytes in flight. Sending never waits: the window is smaller than the 64 KiB
    at which asyncio makes a writer wait. A larger frame is sent if no other frame is in flight."""
    _TRIAL_ACKNOWLEDGEMENTS = 3
    _TOLERANCE, _DOUBLED, _SLACK_S = 1.3, 1.5, 0.008
    _FIRST_PAUSE_S, _LONGEST_PAUSE_S = 2.0, 64.0
    _EASY_S, _NOT_EASY_S, _EASY_ACKNOWLEDGEMENTS = 0.025, 0.05, 8
    _ASK_EVERY = 3

    def __init__(self) -> None:
        self.delay_s: float | None = None
        self._flight: OrderedDict[int, _Sent] = OrderedDict()
        self._bytes = self._asked = 0
        self._pause_s = self._FIRST_PAUSE_S
        self._not_before_s = -math.inf
        self._begin()

    def _begin(self) -> None:
        """Allow one frame in flight, and forget all measurements of the link."""
        self.size = 1
        self.is_easy = False
        self._lone_delay_s: float | None = None
        self._starved = self._slow = self._easy = 0

    def may_send(self, n_bytes: int) -> bool:
        """True if a frame of this size may be sent now; if not, the frame counts as skipped."""
        if not self._asked:  # all frames in flight are quiet
            return True
        if len(self._flight) < self.size and self._bytes + n_bytes <= self.LARGEST_BYTES:
            return True
        self._starved += 1
        return False

    def sent(self, frame_id: int, n_bytes: int, now_s: float, *, is_frequent: bool = True) -> bool:
        """Record that a frame was sent; return True if the frame is quiet.

        `is_frequent` is False after a long pause; the frame then requests an acknowledgement.
        """
        is_quiet = (
            self.is_easy
            and is_frequent
            and len(self._flight) + 1 < self._ASK_EVERY
            and self._bytes + 3 * n_bytes <= self.LARGEST_BYTES
        )
        self._flight[frame_id] = _Sent(now_s, n_bytes, len(self._flight), is_quiet)
        self._bytes += n_bytes
        self._asked += not is_quiet
        return is_quiet

    def acknowledged(self, frame_id: int, now_s: float) -> None:
        """Record that the viewer has drawn a frame; raises ProtocolError if it is not in flight."""
        if frame_id not in self._flight:
            raise ProtocolError(ErrorCode.UNKNOWN_FRAME, f"frame {frame_id} is not in flight")
        while True:
            earlier_id, sent = self._flight.popitem(last=False)
            self._bytes -= sent.size
            self._asked -= not sent.is_quiet
            if earlier_id == frame_id:
                break
        self.delay_s = now_s - sent.at_s
        if self.size == 1 or sent.in_flight == 0:  # no other frame was in flight
            before_s = self._lone_delay_s if self._lone_delay_s is not None else self.delay_s
            self._lone_delay_s = min(self.delay_s, before_s + (self.delay_s - before_s) / 4)
        self._adapt(self.delay_s, now_s)

    def _adapt(self, delay_s: float, now_s: float) -> None:
        if self.is_easy:
            if delay_s > self._NOT_EASY_S:
                self._shrink(now_s)
            return
        self._easy = self._easy + 1 if delay_s < self._EASY_S else 0
        if self._easy >= self._EASY_ACKNOWLEDGEMENTS and now_s >= self._not_before_s:
            self.is_easy, self.size = True, self.LARGEST
            return
        lone_s = self._lone_delay_s if self._lone_delay_s is not None else delay_s
        if self.size > 1 and delay_s > lone_s * self._TOLERANCE + self._SLACK_S:
            self._slow += 1
            is_doubled = delay_s > lone_s * self._DOUBLED + self._SLACK_S
            if is_doubled or self._slow >= self._TRIAL_ACKNOWLEDGEMENTS:
                self._shrink(now_s)
            return
        self._slow = 0
        if self._starved >= self._TRIAL_ACKNOWLEDGEMENTS and now_s >= self._not_before_s:
            self.size = min(self.size + 1, self.LARGEST)
            self._starved = 0
            self._not_before_s = now_s + 4 * delay_s

    def _shrink(self, now_s: float) -> None:
        self._begin()
        self._not_before_s = now_s + self._pause_s
        self._pause_s = min(4 * self._pause_s, self._LONGEST_PAUSE_S)


class PictureSize:
    """Decides whether a viewer gets larger pictures, because not all viewers can draw them in time.

    If a viewer draws them late, the next attempt waits four times as long as the previous one.
    """

    _GOOD_S, _LATE_S = 0.06, 0.12
    _GOOD, _LATE = 8, 3
    _FIRST_PAUSE_S, _LONGEST_PAUSE_S = 5.0, 320.0

    def __init__(self) -> None:
        self.is_large = False
        self._in_row = 0
        self._pause_s = self._FIRST_PAUSE_S
        self._not_before_s = -math.inf

    def note(self, delay_s: float, now_s: float) -> None:
        is_sign = delay_s > self._LATE_S if self.is_large else delay_s < self._GOOD_S
        self._in_row = self._in_row + 1 if is_sign else 0
        if self.is_large and self._in_row >= self._LATE:
            self.is_large, self._in_row = False, 0
            self._not_before_s = now_s + self._pause_s
            self._pause_s = min(4 * self._pause_s, self._LONGEST_PAUSE_S)
        elif not self.is_large and self._in_row >= self._GOOD and now_s >= self._not_before_s:
            self.is_large, self._in_row = True, 0
