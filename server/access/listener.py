"""A listening socket that limits connections when they are accepted.

Because the limit is below TLS and HTTP, it also counts connections with unfinished handshakes, and
it works with every version of uvicorn and asyncio.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import socket
import struct
from collections import deque
from typing import Any

from robot.clock import Clock
from server.access.admission import AdmissionControl, Peer

_AT_ONCE = 1024
"""Maximum number of connections that one call takes from the kernel, even if it closes them."""
_HANDED_ON = 64
"""Maximum number of connections accepted in a row; then the event loop reads from all of them."""
_KEPT_BACK = 128
"""Number of file descriptors that are reserved for files, cameras and the brick."""
_MOST_CONNECTIONS = 1024
_MOST_IN_SELECT = 512
"""Maximum number of sockets that `select` can wait for on Windows."""
_HEAD = 4096
STOP = b"POST /api/stop "
"""First bytes of the request by which a page without a websocket sends STOP."""
_RESET = struct.pack("ii", 1, 0)
_UNREAD_PARTS = 16
"""Maximum part of a refused request that is read, in blocks of 4 KB."""
TOO_MANY_CONNECTIONS = "Too many connections; reuse them, or wait a second."
_BODY = json.dumps({"error": "connections", "detail": TOO_MANY_CONNECTIONS}).encode()
_TOO_MANY = (
    b"HTTP/1.1 429 Too Many Requests\r\nContent-Type: application/json\r\nRetry-After: 1\r\n"
    b"Cache-Control: no-store\r\nConnection: close\r\nContent-Length: %d\r\n\r\n%s"
    % (len(_BODY), _BODY)
)
_EXHAUSTED = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)


def connection_capacity() -> int:
    """Return how many connections the system's limit of file descriptors allows."""
    try:
        import resource
    except ImportError:
        return _MOST_IN_SELECT - _KEPT_BACK
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return max(32, min(_MOST_CONNECTIONS, soft - _KEPT_BACK))


class AdmissionListener(socket.socket):
    """Accepts only connections that `admission` admits; takes over the socket of `listener`."""

    def __init__(self, admission: AdmissionControl, clock: Clock, listener: socket.socket) -> None:
        super().__init__(listener.family, listener.type, listener.proto, fileno=listener.detach())
        self.admission, self.clock = admission, clock
        self._spare: int | None = os.open(os.devnull, os.O_RDONLY)
        # Connections that wait until `accept` returns them, one by one. A None in the queue marks
        # the end of a batch: at a None, `accept` waits for the next event of the socket.
        self._waiting: deque[_Connection | None] = deque()

    def accept(self) -> tuple[socket.socket, Any]:
        """Accept the next connection like `socket.socket.accept`; a STOP comes before the others.

        Raises:
            BlockingIOError: If no connection waits, or after each batch. So the event loop reads
                from a batch of connections before new connections can evict them.
        """
        if not self._waiting:
            self._gather()
            self._waiting.append(None)
        connection = self._waiting.popleft()
        if connection is None:
            raise BlockingIOError(errno.EAGAIN, "no connection is ready")
        return connection, connection.peer

    def _gather(self) -> None:
        """Accept a batch of connections from the kernel; refuse sessions that open too many."""
        for _ in range(_AT_ONCE):
            now_s = self.clock.now_s()
            if len(self._waiting) >= _HANDED_ON or not self.admission.has_room(now_s):
                break
            try:
                plain, address = super().accept()
            except OSError as error:
                if error.errno not in _EXHAUSTED:
                    break
                self._reject_one()
                continue
            connection = _Connection(plain.family, plain.type, plain.proto, fileno=plain.detach())
            connection.peer = str(address[0]), int(address[1])
            connection.setblocking(False)
            head = connection.peek()
            is_stop = head is not None and head.startswith(STOP)
            if head == b"":
                connection.close()
                continue
            if not (is_stop or self.admission.may_come(head or b"", address[0], now_s)):
                connection.refuse()
                continue
            connection.admission = self.admission
            self.admission.arrive(connection.peer, now_s, connection.abort)
            (self._waiting.appendleft if is_stop else self._waiting.append)(connection)

    def close(self) -> None:
        super().close()
        if self._spare is not None:
            os.close(self._spare)
            self._spare = None

    def _reject_one(self) -> None:
        """Accept and close one connection with the spare file descriptor, because no other is left.

        A connection that stayed in the kernel's queue would wake the event loop again and again.
        """
        if self._spare is not None:
            os.close(self._spare)
            self._spare = None
        with contextlib.suppress(OSError):
            super().accept()[0].close()
        with contextlib.suppress(OSError):
            self._spare = os.open(os.devnull, os.O_RDONLY)


class _Connection(socket.socket):
    """An accepted socket that notifies the admission control when it is closed."""

    admission: AdmissionControl | None = None
    peer: Peer = ("", 0)

    def peek(self) -> bytes | None:
        """Return the received bytes, and leave them in the socket's buffer.

        Returns:
            b"" if the client has disconnected, None if it has sent nothing yet.
        """
        try:
            return self.recv(_HEAD, socket.MSG_PEEK)
        except BlockingIOError:
            return None
        except OSError:
            return b""

    def recv(self, size: int, flags: int = 0) -> bytes:
        """Read at most 4 KB at a time, so that one client does not delay the others."""
        return super().recv(min(size, _HEAD), flags)

    def recv_into(self, buffer: Any, size: int = 0, flags: int = 0) -> int:
        return super().recv_into(buffer, min(size or len(buffer), _HEAD), flags)

    def abort(self) -> None:
        """End the connection; the server notices and then closes the socket.

        A busy connection is reset. An idle connection is shut down normally, because its last
        answer may still be on the way.
        """
        admission, self.admission = self.admission, None  # the caller has already freed the slot
        with contextlib.suppress(OSError):
            if admission is None or not admission.is_idle(self.peer):
                self.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
            self.shutdown(socket.SHUT_RDWR)

    def refuse(self) -> None:
        """Answer that this session opens too many connections, and close.

        The request is read first, because the system would otherwise reset the connection, and the
        client would not see the answer.
        """
        with contextlib.suppress(BlockingIOError):
            for _ in range(_UNREAD_PARTS):
                if not self.peek() or not self.recv(_HEAD):
                    break
        with contextlib.suppress(OSError):
            self.send(_TOO_MANY)
            self.shutdown(socket.SHUT_WR)
        self.close()

    def close(self) -> None:
        super().close()
        if self.admission is not None:
            admission, self.admission = self.admission, None
            admission.left(self.peer)
