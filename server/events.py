"""The event bus: from the parts that notice an event to the hub, which tells the clients."""

from __future__ import annotations

from collections.abc import Callable

LASTING = ("set_aside", "nothing_kept")
"""Events that hold as long as the program runs."""


class EventBus:
    """Passes each event on, on the publisher's thread.

    It is created before all publishers, so that nothing has to be connected afterwards.

    Attributes:
        listener: Hears each event, on any thread; it returns at once and never raises.
        lasting: What each client that joins is told.
    """

    def __init__(self) -> None:
        self.listener: Callable[[str, dict[str, object]], None] = lambda name, fields: None
        self.lasting: tuple[tuple[str, dict[str, object]], ...] = ()

    def publish(self, name: str, **fields: object) -> None:
        """Publish one event; one of `LASTING` also to each client that joins later."""
        if name in LASTING:
            self.lasting = (*self.lasting, (name, fields))
        self.listener(name, fields)
