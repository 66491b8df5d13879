"""A stand-in for a robot's topics, for tests in virtual time without a bridge."""

from __future__ import annotations

from typing import Any

from robot.bodies.ros.topics import Topics


class HeldTopics(Topics):
    """Stores published messages; the test sets `silent_s` and `refusal`, and calls `on_message`."""

    silent_s, refusal = 0.0, ""
    advertised: dict[str, str]
    subscribed: dict[str, str]
    on_message: Any

    def __init__(self) -> None:
        self.published: list[tuple[Any, ...]] = []

    def open(self, *_: Any, **given: Any) -> HeldTopics:
        """Replaces `open_topics`."""
        vars(self).update(given)
        return self

    def publish(self, topic: str, message: Any, ends: Any = None) -> None:
        self.published.append((topic, message, ends))

    publish_soon = publish

    def close(self) -> None:
        """There is nothing to close."""
