"""A listening socket that limits connections where they are accepted.

It works below TLS and HTTP, so that an unfinished handshake is counted too, and with every version
of uvicorn and asyncio.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import socket
import struct
from collections import deque
from typing import Any

from robot.clock import Clock
from server.security.door import Door, Newest, Peer, address_key

_AT_ONCE = 1024
"""Connections taken from the kernel at once, before the event loop does other work."""
_KEPT_BACK = 128
"""File descriptors reserved for files, cameras and the brick."""
_MOST_CONNECTIONS = 512
_SWEEP_S = 1.0
_RESET = struct.pack("ii", 1, 0)
_EXHAUSTED = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)


def connection_capacity() -> int:
    """Return how many connections this process may have, by its limit of file descriptors."""
    try:
        import resource
    except ImportError:  # Windows counts handles, and allows many
        return _MOST_CONNECTIONS
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return max(32, min(_MOST_CONNECTIONS, soft - _KEPT_BACK))


class DoorListener(socket.socket):
    """Accepts only connections that its `Door` has room for. Made by `behind`."""

    door: Door
    clock: Clock

    @classmethod
    def behind(cls, door: Door, listener: socket.socket, clock: Clock) -> DoorListener:
        """Return a listener in place of `listener`, which is used up."""
        own = cls(listener.family, listener.type, listener.proto, fileno=listener.detach())
        own.door, own.clock = door, clock
        own._is_round_over, own._arrived = False, deque()
        own._spare = os.open(os.devnull, os.O_RDONLY)
        own._is_sweeping = False
        return own

    _is_round_over: bool
    _arrived: deque[tuple[socket.socket, Any]]
    _spare: int | None
    _is_sweeping: bool

    def accept(self) -> tuple[socket.socket, Any]:
        """Accept the next connection that there is room for; see `socket.socket.accept`.

        Raises:
            BlockingIOError: If none waits, or enough were accepted for now.
        """
        self._start_sweeping()
        if not self._is_round_over and not self._arrived:
            self._arrived = self._take_queue()
        self._is_round_over = True
        while self._arrived:
            plain, address = self._arrived.popleft()
            peer = (str(address[0]), int(address[1]))
            connection = _Connection(plain.family, plain.type, plain.proto, fileno=plain.detach())
            if self.door.arrive(peer, self.clock.now_s(), connection.abort):
                connection.door, connection.peer = self.door, peer
                return connection, address
            connection.abort()
            connection.close()
        self._is_round_over = False
        raise BlockingIOError(errno.EAGAIN, "enough for now")

    def _take_queue(self) -> deque[tuple[socket.socket, Any]]:
        """Empty the kernel's queue; return the newest of each address, as many as may be pending.

        What would be evicted at once is closed here, which costs a hundredth of handing it over:
        else a client would wait for thousands of a flood that came before it.
        """
        found = Newest(self.door.limits.pending_per_address, self.door.limits.pending)
        for _ in range(_AT_ONCE):
            try:
                plain, address = super().accept()
            except OSError as error:
                if error.errno not in _EXHAUSTED:
                    break
                self._reject_one()
                continue
            for old, _ in found.add(address_key(str(address[0])), (plain, address)):
                _reset(old)
                old.close()
                self.door.evicted += 1
        return deque(found)

    def close(self) -> None:
        """Stop listening."""
        super().close()
        while self._arrived:
            self._arrived.popleft()[0].close()
        if self._spare is not None:
            os.close(self._spare)
            self._spare = None

    def _reject_one(self) -> None:
        """Accept the next connection with the spare descriptor, and close it: left in the queue, it
        would wake the event loop again and again."""
        if self._spare is not None:
            os.close(self._spare)
            self._spare = None
        with contextlib.suppress(OSError):
            super().accept()[0].close()
        with contextlib.suppress(OSError):
            self._spare = os.open(os.devnull, os.O_RDONLY)

    def _start_sweeping(self) -> None:
        if self._is_sweeping:
            return
        self._is_sweeping = True
        event_loop = asyncio.get_running_loop()

        def sweep() -> None:
            self.door.expire(self.clock.now_s())
            if self.door.open and self.fileno() >= 0:
                event_loop.call_later(_SWEEP_S / 2, sweep)
            else:
                self._is_sweeping = False

        event_loop.call_later(_SWEEP_S / 2, sweep)


class _Connection(socket.socket):
    """An accepted socket that tells the door when it is closed."""

    door: Door | None = None
    peer: Peer = ("", 0)

    def abort(self) -> None:
        """Reset the connection, so that both sides see the end; its owner then closes it."""
        _reset(self)
        with contextlib.suppress(OSError):
            self.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Close it."""
        super().close()
        if self.door is not None:
            door, self.door = self.door, None
            door.left(self.peer)


def _reset(connection: socket.socket) -> None:
    """Have the connection end with a reset when it is closed."""
    with contextlib.suppress(OSError):
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
