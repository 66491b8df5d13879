"""Reads rosbridge's status messages, and unwraps messages inside other messages.

A `status` has a level and a text (section 3.4.1 of ROSBRIDGE_PROTOCOL.md, version 2). A `fragment`
is one part of a long message (3.1.1). A `png` contains a message as the pixels of a picture
(3.1.2). rosbridge drops a message that it refuses, and reports the refusal only in a `status`.
"""

from __future__ import annotations

import base64
import json
import logging
from collections.abc import Iterator, Mapping
from typing import Any

from robot.errors import MissingExtraError, need, told_as

log = logging.getLogger(__name__)
REFUSED_S = 1.0
"""A refusal expires after this time, in seconds. A refused topic is requested twice within this
time, so a lasting refusal is renewed before it expires."""
_HARMLESS = ("info", "none")
_LONGEST_TEXT = 300
_MOST_PARTS, _MOST_BYTES = 1000, 6 * 2**20
"""Maximum number of parts and of characters of a message that arrives in fragments."""
_DEEPEST = 4
"""Maximum number of layers around a message. A message in a picture that arrives in fragments has
two layers."""


class Refusals:
    """Remembers the newest refusal, and writes each warning to the log once."""

    def __init__(self) -> None:
        self._text, self._heard_s = "", float("-inf")
        self._warned: set[str] = set()

    def at(self, now_s: float) -> str:
        """Return the current refusal, in rosbridge's words; empty if there is none."""
        return self._text if now_s - self._heard_s < REFUSED_S else ""

    def take(self, status: Mapping[str, Any], now_s: float) -> bool:
        """Process a status; return True if it is a refusal.

        An unknown level counts as a refusal.
        """
        level = str(status.get("level", "error")).lower()
        text = str(status.get("msg") or "no reason given")[:_LONGEST_TEXT]
        request = status.get("id")
        if isinstance(request, str) and request and request.partition(":")[2] not in text:
            text = f"{request[:_LONGEST_TEXT]}: {text}"
        if level in _HARMLESS:
            return False
        if level == "warning":
            if text not in self._warned and len(self._warned) < _MOST_PARTS:
                self._warned.add(text)
                log.warning("rosbridge warns: %s", text)
            return False
        self._text, self._heard_s = text, now_s
        return True


class Unwrapping:
    """Unwraps received data to messages."""

    def __init__(self) -> None:
        self._parts: dict[str, dict[int, str]] = {}

    def messages(self, text: str | bytes) -> Iterator[Mapping[str, Any]]:
        """Yield the message that the received data completes, if any. An unreadable message is
        ignored."""
        for _ in range(_DEEPEST):
            try:
                message = json.loads(text)
                if not isinstance(message, dict):
                    return
                operation = message.get("op")
                if operation == "fragment":
                    whole = self._join(message)
                elif operation == "png":
                    whole = _text_of_png(message["data"])
                else:
                    yield message
                    return
            except (ValueError, KeyError, TypeError, RecursionError):
                return
            if whole is None:
                return
            text = whole

    def _join(self, part: Mapping[str, Any]) -> str | None:
        """Return the text once all parts have arrived; the order of arrival does not matter."""
        key, number, total = str(part["id"]), int(part["num"]), int(part["total"])
        if not 0 <= number < total <= _MOST_PARTS:
            raise ValueError(f"a message of {total} parts has no part {number}")
        parts = self._parts.pop(key, {})
        parts[number] = str(part["data"])
        if len(parts) == total:
            return "".join(parts[at] for at in range(total))
        self._parts[key] = parts  # added last, so the first keys are the oldest
        while sum(len(data) for some in self._parts.values() for data in some.values()) > (
            _MOST_BYTES
        ):
            del self._parts[next(iter(self._parts))]
        return None


def _text_of_png(data: str) -> str:
    """Decode a PNG from rosbridge. The bytes of its pixels are text, padded with newlines."""
    import numpy as np

    try:
        cv2 = need("cv2", "a rosbridge that compresses by PNG", "camera")
    except MissingExtraError as error:
        raise ValueError(str(error)) from error
    with told_as(ValueError, "no PNG", cv2.error):  # cv2 also raises this error for empty input
        pixels = cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_COLOR)
    if pixels is None:
        raise ValueError("no PNG")
    return bytes(pixels[:, :, ::-1].tobytes()).decode()


def advice_for(refusal: str, *, is_stamped: bool, has_watchdog: bool) -> str:
    """Return advice about a refused velocity or picture; empty if there is none."""
    said = refusal.lower()
    if "twiststamped" in said and not is_stamped:
        return "start with --stamped true"
    if "geometry_msgs" in said and "twiststamped" not in said and is_stamped:
        return "another node uses the watchdog's topic" if has_watchdog else "omit --stamped"
    if "sensor_msgs/msg/image" in said and "compressedimage" not in said.partition(", not")[0]:
        return (
            "give a topic of sensor_msgs/CompressedImage with --image-topic, or add "
            "--image-type raw"
        )
    if "sensor_msgs" in said and "image" in said:
        return "give a topic of pictures with --image-topic, and omit --image-type"
    if "already" in said and "type" in said:
        return "choose another topic, or end the node that uses this topic"
    if "glob" in said or "not allowed" in said or "not authorized" in said:
        return "allow the topic in rosbridge's own settings (topics_glob)"
    return ""
