"""One page at the other end of `/ws/drive`, and what it is still to be told."""

from __future__ import annotations

import asyncio
from collections import deque

from server.clients.flow_control import Order
from server.config import Config
from server.security.access import Role
from server.security.pace import Pace

_OUTBOX = 64
"""Answers that may wait for one page; a page that reads so slowly loses the oldest."""


IDLE_STATE_EVERY_S = 5.0
"""A page that shows no picture is told the state so often, and whenever it changes."""


class Client:
    """One open `/ws/drive`: its order and pace, and what it is still to be told.

    Answers wait in a short queue; of states only the newest waits.
    """

    def __init__(self, client: str, role: Role, config: Config, now_s: float) -> None:
        limits = config.limits
        self.client = client
        self.role = role
        self.order = Order()
        self.pace = Pace(per_second=limits.words_per_second, burst=limits.words_burst)
        self.refused = 0
        self.is_idle = False
        self._told: object = None
        self._told_s = now_s
        self.last_word_s = now_s
        self._answers: deque[str] = deque(maxlen=_OUTBOX)
        self._state: str | None = None
        self._waiting = asyncio.Event()

    def tell(self, text: str) -> None:
        """Have an answer or event sent."""
        self._answers.append(text)
        self._waiting.set()

    def tell_state(self, text: str) -> None:
        """Have a state sent, in place of any that still waits."""
        self._state = text
        self._waiting.set()

    def wants_state(self, gist: object, now_s: float) -> bool:
        """True if a state is to be sent now; an idle page hears of changes, and of no more.

        Args:
            gist: What a page must hear of at once.
            now_s: The time.
        """
        if self.is_idle and gist == self._told and now_s - self._told_s < IDLE_STATE_EVERY_S:
            return False
        self._told, self._told_s = gist, now_s
        return True

    async def next_text(self) -> str:
        """Wait for what is to be sent next."""
        while True:
            await self._waiting.wait()
            if self._answers:
                return self._answers.popleft()
            state, self._state = self._state, None
            if state is not None:
                return state
            self._waiting.clear()
