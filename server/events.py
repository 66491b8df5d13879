"""What happens once, from the parts that notice it to the clients."""

from __future__ import annotations

from collections.abc import Callable

Subscriber = Callable[[str, dict[str, object]], None]


class EventBus:
    """Hands each event to all subscribers, on the publisher's thread.

    It is made before everything that publishes, so that nothing has to be connected afterwards.
    """

    def __init__(self) -> None:
        self._subscribers: tuple[Subscriber, ...] = ()
        self.lasting: tuple[tuple[str, dict[str, object]], ...] = ()
        """What holds for as long as the program runs: told to everybody who joins later, too."""

    def subscribe(self, subscriber: Subscriber) -> Callable[[], None]:
        """Call `subscriber(name, fields)` for each event; return what ends that.

        Args:
            subscriber: Called on any thread; must return at once and not raise.
        """
        self._subscribers = (*self._subscribers, subscriber)

        def unsubscribe() -> None:
            self._subscribers = tuple(s for s in self._subscribers if s is not subscriber)

        return unsubscribe

    def publish(self, name: str, **fields: object) -> None:
        """Publish one event; where nobody has subscribed it is dropped."""
        for subscriber in self._subscribers:
            subscriber(name, fields)

    def publish_lasting(self, name: str, **fields: object) -> None:
        """Publish one event now, and to whoever joins from now on."""
        self.lasting = (*self.lasting, (name, fields))
        self.publish(name, **fields)
