"""The lease of control: at most one client drives. Pure; the time is an argument."""

from __future__ import annotations

import math

LAPSE_S = 1.5


class Lease:
    """The wheel: at most one client has it, and renews it by its commands.

    A lease that was not renewed for `LAPSE_S` has lapsed: its owner keeps it until another client
    asks for it. A client that asks for a lease in use waits until it is yielded or lapses.
    """

    def __init__(self) -> None:
        self.owner: str | None = None
        self._asked: dict[str, None] = {}  # in their order
        self._renewed_s = -math.inf

    def join(self, client: str, now_s: float) -> bool:
        """Give the wheel to a client that may drive, if it is free; True if it was."""
        is_next = client == next(iter(self._asked), client)
        if self.owner is None or (is_next and self._has_lapsed(now_s)):
            self._give(client, now_s)
            return True
        return False

    def take(self, client: str, now_s: float) -> bool:
        """Ask for the wheel; True if the client has it now, False if it waits for it."""
        if self.owner == client or self.join(client, now_s):
            return True
        self._asked[client] = None
        return False

    def renew(self, now_s: float) -> None:
        self._renewed_s = now_s

    def give_up(self, client: str, now_s: float) -> bool:
        """`client` yields or has disconnected; True if it was the owner. Who waits is next."""
        self._asked.pop(client, None)
        if self.owner != client:
            return False
        self.owner = None
        if self._asked:
            self._give(next(iter(self._asked)), now_s)
        return True

    def pass_on_if_lapsed(self, now_s: float) -> bool:
        """Give a lapsed wheel to the waiting client; True if the owner changed."""
        if not self._asked or not self._has_lapsed(now_s):
            return False
        self._give(next(iter(self._asked)), now_s)
        return True

    def _has_lapsed(self, now_s: float) -> bool:
        return now_s - self._renewed_s > LAPSE_S

    def _give(self, client: str, now_s: float) -> None:
        self.owner = client
        self._renewed_s = now_s
        self._asked.pop(client, None)
