"""Accepts connections to the agent, limits them, and authenticates them."""

import json
import os
import socket
import time
from typing import Any, Callable, Dict, Iterator, List, Optional

from robot.bodies.ev3.agent.wire import (
    BEFORE_JOINING,
    FROM_CONTROLLER,
    PROTOCOL,
    Seal,
    Unpacker,
    is_proof,
    pack,
    pack_json,
    prove,
)

MAX_UNJOINED = 12
"""Maximum number of connections that have not yet proved that they know the secret, from all
addresses together."""
JOIN_S = 1.0
"""Time within which a client must prove that it knows the secret, in seconds."""
ACCEPT_PAUSE_S = 0.2
"""Pause after an error of `accept`, such as a lack of descriptors or memory, in seconds."""
LARGEST_OUTBOX = 1 << 20
"""Maximum number of bytes that wait to be sent to a controller. A controller that reads too slowly
for this limit is disconnected."""


class Caller:
    """One connection.

    The caller may send commands only after both sides have proved that they know the secret.
    """

    def __init__(self, line: socket.socket, name: str, now_s: float) -> None:
        self.line = line
        self.name = name
        self.since_s = now_s
        self.received_s = now_s
        self.has_joined = False
        self.outbox = b""
        self._nonce = os.urandom(16).hex()
        self._unpacker = Unpacker(BEFORE_JOINING)
        self._seal = None  # type: Optional[Seal]
        self.send({"hello": PROTOCOL, "nonce": self._nonce})

    def receive(self) -> Iterator[Dict[str, Any]]:
        """Receive the waiting data; yield each complete message.

        Raises ValueError if a message is invalid, and EOFError if the other side has closed the
        connection.
        """
        data = self.line.recv(65536 if self.has_joined else max(BEFORE_JOINING.values()))
        if not data:
            raise EOFError("the client closed the connection")
        for _, body in self._unpacker.take(data):
            message = json.loads(body.decode())
            if not isinstance(message, dict):
                raise ValueError("this is not a message of the agent's protocol")
            yield message

    def proves(self, message: Dict[str, Any], secret: str) -> bool:
        """True if a message asks to join and proves that its sender knows the secret."""
        nonce = str(message.get("nonce"))
        if message.get("do") != "join" or len(nonce) < 16:
            return False
        return is_proof(message.get("proof"), secret, "controller", self._nonce, nonce)

    def welcome(self, nonce: str, secret: str) -> None:
        """Prove to the controller that the agent knows the secret, too. All later messages are
        sealed."""
        self.send({"welcome": PROTOCOL, "proof": prove(secret, "agent", self._nonce, nonce)})
        self._seal = Seal(secret, "agent", self._nonce, nonce)
        seal = Seal(secret, "controller", self._nonce, nonce)
        self._unpacker.expect_seal(seal, FROM_CONTROLLER)
        self.has_joined = True

    def send(self, message: Dict[str, Any]) -> None:
        self._queue(pack_json(message, self._seal))

    def send_picture(self, body: bytes) -> None:
        self._queue(pack(b"F", body, self._seal))

    def _queue(self, data: bytes) -> None:
        if len(self.outbox) + len(data) > LARGEST_OUTBOX:
            raise EOFError("the client reads its messages too slowly")
        self.outbox += data

    def flush(self) -> None:
        """Send as many of the waiting bytes as the connection takes at once."""
        if self.outbox:
            try:
                sent = self.line.send(self.outbox)
            except BlockingIOError:
                return
            self.outbox = self.outbox[sent:]


class CallerLimiter:
    """Accepts a limited number of connections, and continues after network errors."""

    def __init__(self, listener: socket.socket, note: Callable[[str], None]) -> None:
        listener.setblocking(False)
        # Limit the kernel's buffer for each unauthenticated client; short commands fit into it.
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 16384)
        self.listener = listener
        self._note = note
        self.callers = []  # type: List[Caller]
        self._closed_until_s = 0.0

    def is_open(self, now_s: float) -> bool:
        """Return False for a short time after an error of `accept`, because the same error would
        follow immediately."""
        return now_s >= self._closed_until_s

    def accept(self, now_s: float) -> None:
        """Accept one connection. If too many clients wait to be authenticated, or if the system is
        out of descriptors or memory, disconnect one of these clients."""
        try:
            line, address = self.listener.accept()
        except BlockingIOError:
            return
        except OSError as error:
            self._closed_until_s = now_s + ACCEPT_PAUSE_S
            self._make_room("out of resources ({})".format(error.strerror))
            return
        try:
            line.setblocking(False)
            line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            line.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 65536)
        except OSError:
            line.close()  # the client has already closed the connection
            return
        self.callers.append(Caller(line, address[0], now_s))
        if sum(not caller.has_joined for caller in self.callers) > MAX_UNJOINED:
            self._make_room("too many others wait to join")

    def _make_room(self, why: str) -> None:
        """Drop one connection that has not joined: the oldest one from the address with the most
        such connections. An address that opens many connections therefore loses only its own
        connections."""
        unjoined = [caller for caller in self.callers if not caller.has_joined]
        names = [caller.name for caller in unjoined]
        if unjoined:
            self.drop(max(unjoined, key=lambda one: (names.count(one.name), -one.since_s)), why)

    def drop(self, caller: Caller, why: str) -> None:
        self._note("{} left: {}".format(caller.name, why))
        self.callers.remove(caller)
        caller.line.close()


class LimitedLog:
    """Prints at most `LINES_A_MINUTE` lines a minute, so clients cannot fill the memory card."""

    LINES_A_MINUTE = 20

    def __init__(self) -> None:
        self._minute = -1
        self._lines = 0

    def note(self, text: str) -> None:
        minute = int(time.monotonic() / 60)
        if minute != self._minute:
            if self._lines > self.LINES_A_MINUTE:
                print("{} more lines".format(self._lines - self.LINES_A_MINUTE), flush=True)
            self._minute, self._lines = minute, 0
        self._lines += 1
        if self._lines <= self.LINES_A_MINUTE:
            print(text, flush=True)
