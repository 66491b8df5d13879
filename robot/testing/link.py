"""A link between page and robot in virtual time, with delay, jitter, throttling and silence.

Messages keep their order, as over TCP: after a loss the link stalls, and then delivers all waiting
messages at once.
"""

from __future__ import annotations

import asyncio
import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(slots=True, kw_only=True)
class LinkConditions:
    """The conditions of a link. If a test changes the conditions, the change applies to all later
    messages."""

    delay_s: float = 0.0
    jitter_s: float = 0.0
    """Largest random extra delay of a packet, in seconds. Packets stay in order."""
    bytes_per_second: float | None = None
    """Bandwidth towards the page; the other direction is unlimited."""
    stall_share: float = 0.0
    """Share of packets that must be sent again. Meanwhile all later packets wait."""
    stall_s: float = 0.2
    is_silent: bool = False
    """True while the link drops all messages without telling either side."""


class Link:
    """A link with two directions per connection, all under the same conditions.

    Args:
        dice: Random source of jitter and stalls.
    """

    def __init__(self, dice: random.Random) -> None:
        self.dice = dice
        self._conditions = LinkConditions()
        self._lines: list[Line] = []

    @property
    def conditions(self) -> LinkConditions:
        """The current conditions of the link, which a test may replace."""
        return self._conditions

    @conditions.setter
    def conditions(self, conditions: LinkConditions) -> None:
        self._conditions = conditions
        for line in self._lines:
            line.flush()

    def line(self, deliver: Callable[[Any], None], *, throttled: bool) -> Line:
        """Return one direction of a new connection; messages are passed to `deliver`."""
        line = Line(self, deliver, throttled=throttled)
        self._lines.append(line)
        return line

    def forget(self, line: Line) -> None:
        """Close one direction of a connection. Messages that were sent but not delivered are
        lost."""
        line.is_cut = True
        if line in self._lines:
            self._lines.remove(line)


class Line:
    """One direction of one connection."""

    HOLDS_BYTES = 8192
    """`has_room` blocks the sender while more than this number of bytes are in transit."""

    def __init__(self, link: Link, deliver: Callable[[Any], None], *, throttled: bool) -> None:
        self._link = link
        self._deliver = deliver
        self._throttled = throttled
        self._event_loop = asyncio.get_running_loop()
        self._under_way: deque[tuple[float, int, Any]] = deque()
        self._bytes = 0
        self._free_s = 0.0
        self._last_due_s = 0.0
        self._room = asyncio.Event()
        self.is_cut = False

    def send(self, item: Any, size: int) -> None:
        """Send `item`; `size` is in bytes."""
        conditions, event_loop = self._link.conditions, self._event_loop
        now_s = event_loop.time()
        free_s = max(self._free_s, now_s)
        if self._throttled and conditions.bytes_per_second:
            free_s += size / conditions.bytes_per_second
        if conditions.stall_share and self._link.dice.random() < conditions.stall_share:
            free_s += conditions.stall_s
        self._free_s = free_s
        late_s = conditions.delay_s
        if conditions.jitter_s:
            late_s += self._link.dice.random() * conditions.jitter_s
        due_s = self._last_due_s = max(self._last_due_s, free_s + late_s)
        self._under_way.append((due_s, size, item))
        self._bytes += size
        if due_s <= now_s:
            event_loop.call_soon(self.flush)
        else:
            event_loop.call_at(due_s, self.flush)

    async def has_room(self) -> None:
        """Wait until the buffer has room for another message."""
        while self._bytes > self.HOLDS_BYTES and not self.is_cut:
            self._room.clear()
            await self._room.wait()

    def flush(self) -> None:
        """Deliver all messages that are due, unless the link is silent."""
        now_s = self._event_loop.time() + 1e-6
        while self._under_way and self._under_way[0][0] <= now_s:
            if self._link.conditions.is_silent or self.is_cut:
                return
            _, size, item = self._under_way.popleft()
            self._bytes -= size
            self._deliver(item)
        self._room.set()
