"""One client of `/ws/drive`, and the messages that are queued for it."""

from __future__ import annotations

import asyncio
from collections import Counter, deque

from server.clients.rate_limit import RateLimit
from server.config import Limits
from server.gateway.roles import Role
from server.protocol import ErrorCode, ProtocolError, encode_error

_OUTBOX = 64
"""Maximum number of messages queued for one client; if it reads too slowly, the oldest are lost."""

IDLE_STATE_EVERY_S = 5.0
"""Interval in seconds at which a client that shows no picture gets the state. A change of mode,
pilot or fault is sent to it immediately."""


class RefusalCounter:
    """Counts the refused messages of one connection; `shut_out` is set if there are too many.

    Refusals of late messages do not count, because a slow link causes them.

    Args:
        most: The number of refusals after which the client must be disconnected.
        by_code: Counts the refusals of all connections.
    """

    def __init__(self, most: int, by_code: Counter[ErrorCode]) -> None:
        self.number = 0
        self.shut_out = asyncio.Event()
        self._most, self._by_code = most, by_code

    def note(self, error: ProtocolError) -> None:
        self._by_code[error.code] += 1
        self.number += error.code is not ErrorCode.STALE
        if self.number >= self._most:
            self.shut_out.set()


class Client:
    """One open `/ws/drive`: checks its message numbers, limits its rate, queues its messages.

    Answers and events wait in a short queue. Only the newest state waits, because each state
    replaces the previous one.
    """

    def __init__(
        self, client_id: str, role: Role, person: str, limits: Limits, refused: Counter[ErrorCode]
    ) -> None:
        self.id = client_id
        self.role = role
        self.person = person
        self._last_seq = 0
        self.pace = RateLimit(per_second=limits.messages_per_second, burst=limits.messages_burst)
        self.refusals = RefusalCounter(limits.refused_before_closing, refused)
        self.is_idle = self.is_answer_due = False
        self._sent: object = None
        self._sent_s = 0.0
        self._answers: deque[str] = deque(maxlen=_OUTBOX)
        self._state: str | None = None
        self._waiting = asyncio.Event()

    def require_newer(self, seq: int) -> None:
        """Raise ProtocolError unless `seq` is greater than that of every earlier message."""
        if seq <= self._last_seq:
            wanted = f"'seq' must be greater than {self._last_seq}, the last 'seq'"
            raise ProtocolError(ErrorCode.OUT_OF_ORDER, wanted, seq)
        self._last_seq = seq

    def send(self, text: str) -> None:
        self._answers.append(text)
        self._waiting.set()

    def refuse(self, error: ProtocolError) -> None:
        """Count a refused message, and queue the answer to it."""
        self.refusals.note(error)
        self.send(encode_error(error))

    def send_state(self, text: str) -> None:
        """Queue a state; it replaces a state that is still queued."""
        self._state = text
        self._waiting.set()

    def is_state_due(self, urgent: object, now_s: float) -> bool:
        """True if the next state is due: rarely for an idle client, at once if `urgent` changed."""
        is_new = urgent != self._sent or self.is_answer_due
        if self.is_idle and not is_new and now_s - self._sent_s < IDLE_STATE_EVERY_S:
            return False
        self._sent, self._sent_s, self.is_answer_due = urgent, now_s, False
        return True

    async def next_text(self) -> str:
        while True:
            await self._waiting.wait()
            if self._answers:
                return self._answers.popleft()
            state, self._state = self._state, None
            if state is not None:
                return state
            self._waiting.clear()
