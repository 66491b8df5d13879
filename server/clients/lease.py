"""The lease of control: at most one client drives. Pure; the time is an argument."""

from __future__ import annotations

import math

LAPSE_S = 1.5


class Lease:
    """The right to drive. At most one client owns the lease, and renews it with each command.

    A lease lapses if it is not renewed for `LAPSE_S`. The lease passes to a waiting client when the
    owner yields or the lease has lapsed. Until another client requests a lapsed lease, the owner
    keeps it.
    """

    def __init__(self) -> None:
        self._line: list[str] = []  # the owner, then the clients that wait, in order
        self._renewed_s = -math.inf

    @property
    def owner(self) -> str | None:
        return self._line[0] if self._line else None

    @property
    def is_asked(self) -> bool:
        """True while a client waits for the wheel."""
        return len(self._line) > 1

    def join(self, client: str, now_s: float) -> bool:
        """Take the wheel if it is free, or if its owner's lease has lapsed and no other client
        waits for it. Return True if the client has the wheel now."""
        is_next = self._line[1:2] in ([], [client])
        if self._line and not (is_next and self._has_lapsed(now_s)):
            return False
        self._line[:2] = [client]
        self.renew(now_s)
        return True

    def take(self, client: str, now_s: float) -> bool:
        """Request the wheel; return True if the client has it now, False if the client waits."""
        if self.owner == client or self.join(client, now_s):
            return True
        if client not in self._line:
            self._line.append(client)
        return False

    def renew(self, now_s: float) -> None:
        self._renewed_s = now_s

    def give_up(self, client: str, now_s: float) -> bool:
        """Take the wheel from a client that yields or has disconnected; the next client gets it.

        Return False if the client was not the owner. A client that was waiting stops waiting.
        """
        was_owner = self.owner == client
        if client in self._line:
            self._line.remove(client)
        if was_owner:
            self.renew(now_s)
        return was_owner

    def pass_on_if_lapsed(self, now_s: float) -> bool:
        """Give a lapsed lease to the waiting client; return True if the owner changed."""
        if not self.is_asked or not self._has_lapsed(now_s):
            return False
        return self.give_up(self._line[0], now_s)

    def _has_lapsed(self, now_s: float) -> bool:
        return now_s - self._renewed_s > LAPSE_S
