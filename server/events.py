"""The event bus: from the parts that notice an event to those that publish it to clients."""

from __future__ import annotations

from collections.abc import Callable

LASTING = ("set_aside", "nothing_kept")
"""Events that hold as long as the program runs."""
Subscriber = Callable[[str, dict[str, object]], None]


class EventBus:
    """Passes each event to all subscribers, on the publisher's thread.

    It is created before all publishers, so that nothing has to be connected afterwards.
    """

    def __init__(self) -> None:
        self._subscribers: tuple[Subscriber, ...] = ()
        self.lasting: tuple[tuple[str, dict[str, object]], ...] = ()

    def subscribe(self, subscriber: Subscriber) -> Callable[[], None]:
        """Have each event, on any thread; the subscriber returns at once and never raises."""
        self._subscribers = (*self._subscribers, subscriber)

        def unsubscribe() -> None:
            self._subscribers = tuple(s for s in self._subscribers if s is not subscriber)

        return unsubscribe

    def publish(self, name: str, **fields: object) -> None:
        """Publish one event; one of `LASTING` also to each client that joins later."""
        if name in LASTING:
            self.lasting = (*self.lasting, (name, fields))
        for subscriber in self._subscribers:
            subscriber(name, fields)
