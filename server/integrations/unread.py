"""Decides when a viewer that cannot acknowledge frames has read enough to get another one.

Unread bytes are in flight, or in the client's receive buffer, which shrinks the window that its
system offers. Only Linux reports both.
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
"""Number of unread bytes that are ignored, because windows are reported in steps of kilobytes."""
_PATIENCE = 2048
"""Number of calls after which a viewer that seems not to read gets a frame anyway. The number is a
power of two, and doubles after each such frame."""
_REPORTED = 256
"""Number of calls after which the client's system has reported its window, once a second."""

Measure = Callable[[], tuple[int, int] | None]
"""Returns the number of bytes in flight and the client's window, both in bytes; None if unknown."""


class Room:
    """Room for a frame on the way to one client."""

    def __init__(self, measure: Measure) -> None:
        self._measure = measure
        self._widest = self._waited = self._tried = 0

    def is_there(self, n_bytes: int) -> bool:
        """Return True if most of a frame of `n_bytes` is read, or if that is unknown.

        A client holds at most two unread frames, because its system may receive the first without a
        smaller window. The caller repeats the call every 10 ms while the answer is False. Some
        systems reduce their window permanently although nothing is unread. So a frame is sometimes
        sent although the window seems too small: if the window is afterwards at least as large as
        before, the client has read the frame, and this window counts as its largest.
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
    """Return the measurement of this server's connection with a client.

    The connection belongs to the server's library, which gives no access to it. The connection is
    found among the open files of this process by the client's address, and checked before each use.
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
                    connection.detach()  # the descriptor still belongs to the server
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
    except (OSError, ValueError):  # the socket is listening, or is not a network socket
        return None
    return host, port


def _ask_for_windows(connection: socket.socket) -> None:
    """Have the client's system report its window each second while nothing is sent.

    The system does not always report unasked that the client has read more.
    """
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 1)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 1)
