"""Measures whether a viewer that cannot acknowledge frames has read the last frame.

Unread bytes are either in flight or in the client's receive buffer. Bytes in this buffer reduce the
TCP window that the client's system offers. Only on Linux can the server read both numbers.
"""

from __future__ import annotations

import socket
import struct
import sys
from collections.abc import Callable
from pathlib import Path

_FILES = Path("/proc/self/fd")
_WINDOW_AT = 228
"""Offset of `tcpi_snd_wnd` in Linux's `struct tcp_info` (5.4 and newer), in bytes."""
_LEAST_ROOM = 2048
"""Number of unread bytes that are ignored, because TCP windows change in steps of kilobytes."""
_PATIENCE = 2048
"""If a viewer seems not to read, it gets a frame anyway after this number of calls of `is_there`.
The number must be a power of two. After each frame that is sent anyway, the number doubles."""
_REPORTED = 256
"""A viewer that seems not to read, but got a frame anyway, is checked after this number of further
calls of `is_there`. By then, after 2.56 s, the client's system has reported its window again, as it
does once a second."""

Measure = Callable[[], tuple[int, int] | None]
"""Returns the number of bytes in flight and the client's window, both in bytes; None if unknown."""


class Room:
    """Decides whether a viewer has read enough to get another frame."""

    def __init__(self, measure: Measure) -> None:
        self._measure = measure
        self._widest = self._waited = self._tried = 0

    def is_there(self, n_bytes: int) -> bool:
        """Return True if the viewer has read most of the last frame, whose size is `n_bytes`. Also
        return True if this cannot be measured.

        The caller repeats the call every 10 ms while the answer is False. A client's system may
        buffer one frame without reducing its window. The measurement misses that frame, so up to
        two frames can be unread.

        Some systems reduce their window permanently although nothing is unread. So after
        `_PATIENCE` calls with the answer False, the method returns True once, and the caller sends
        a frame as a test. After `_REPORTED` further calls, the window is compared with the window
        before the test. If the window is not smaller than that, the viewer has read the test frame.
        From then on, a window of this size means that nothing is unread.
        """
        measured = self._measure()
        if measured is None:
            return True
        in_flight, window = measured
        self._widest = max(self._widest, window)
        unread = in_flight + self._widest - window
        if unread <= max(0.75 * n_bytes, _LEAST_ROOM):
            self._waited = self._tried = 0
            return True
        self._waited += 1
        if self._tried and self._waited % _PATIENCE == _REPORTED and window >= self._tried:
            self._widest, self._waited = window, 0
        is_due = self._waited >= _PATIENCE and self._waited.bit_count() == 1
        if is_due:
            self._tried = window
        return is_due


def measure_connection(peer: tuple[str, int]) -> Measure:
    """Return a function that measures this server's connection with the client at `peer`.

    Uvicorn gives no access to the connection's socket. The function finds the socket by the
    client's address among the open files of this process, and checks it again before each use.
    """
    known: list[int] = []

    def measure() -> tuple[int, int] | None:
        try:
            import fcntl
            import termios

            for file in known or [int(path.name) for path in _FILES.iterdir()]:
                connection = _open(file)
                if connection is None:
                    continue
                try:
                    if _peer_of(connection) != peer:
                        continue
                    if not known:
                        known.append(file)
                        _ask_for_windows(connection)
                    size = bytearray(4)
                    fcntl.ioctl(file, termios.TIOCOUTQ, size)
                    info = connection.getsockopt(
                        socket.IPPROTO_TCP, socket.TCP_INFO, _WINDOW_AT + 4
                    )
                finally:
                    connection.detach()  # otherwise the server's descriptor would be closed
                window = struct.unpack_from("I", info, _WINDOW_AT)[0]
                return int.from_bytes(size, sys.byteorder), int(window)
        except (ImportError, AttributeError, OSError, struct.error):
            pass
        return None

    return measure


def _open(file: int) -> socket.socket | None:
    try:
        return socket.socket(fileno=file)
    except OSError:  # the descriptor is not a socket
        return None


def _peer_of(connection: socket.socket) -> tuple[str, int] | None:
    try:
        host, port = connection.getpeername()[:2]
    except (OSError, ValueError):  # not a TCP connection
        return None
    return host, port


def _ask_for_windows(connection: socket.socket) -> None:
    """Turn on TCP keep-alive with a period of one second. The client's system answers each probe
    with its current receive window.

    Without these probes, the client's system does not always report that the client has read
    something.
    """
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 1)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 1)
