"""A fast path through uvicorn for video: frames are written directly, without ASGI and its tasks.

With ASGI, each frame to a viewer costs two task switches, and uvicorn pauses reading for each
acknowledgement of a frame. The fast path avoids these costs; `drivelesson bench link` measures them
with 16 viewers and 30 frames a second. The fast path also reads short messages, such as
acknowledgements and commands, without the parser of the `websockets` library. If uvicorn is too old
for sans-I/O websockets, frames go through ASGI with the same behaviour.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar

from server.hosting.serving import DIRECT

if TYPE_CHECKING:
    from websockets.http11 import Request

FRAME_S, BURST_S = 0.004, 3.0
"""Rate limit of received websocket frames: the time per frame and the length of a burst, both in
seconds. Frames beyond the limit are not read for a while, so that their sender has to wait."""
_SHORT_BYTES = 125
"""Length in bytes of the longest message with the shortest frame header (RFC 6455, section 5.2)."""
_HEAD_BYTES = 6
"""Length in bytes of the shortest frame header from a client, which includes a mask."""
_TEXT, _BINARY = 0x81, 0x82
"""The first byte of a frame that is a complete message of text or of bytes."""


def make_protocol() -> type[Any] | None:
    """Return a websocket protocol class for uvicorn; None if uvicorn is too old."""
    try:
        from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
    except ImportError:
        return None
    from websockets.frames import Frame, Opcode
    from websockets.protocol import State

    class FastPathProtocol(WebSocketsSansIOProtocol):
        """The websocket protocol of uvicorn, with the fast path."""

        on_bytes: Callable[[bytes], None] | None = None
        """If set, this function gets each binary message. ASGI's `receive` then does not return the
        message."""
        on_text: Callable[[str], None] | None = None
        """Called with each text as soon as it is read, even after the server began to close.

        A text does not wait in a queue behind earlier messages.
        """
        _read_s = -math.inf
        """Each received frame moves this time `FRAME_S` later (seconds of the event loop's clock).
        While the time lies in the future, nothing is read, which limits the rate of frames."""
        _is_held = False
        _written: ClassVar[tuple[bytes, bytes]] = b"", b""
        """The last message written to any viewer, and its frame, which all viewers share."""

        def handle_connect(self, event: Request) -> None:
            super().handle_connect(event)
            if hasattr(self, "scope"):  # the attribute is missing if the handshake was refused
                scope: dict[str, Any] = self.scope  # type: ignore[assignment]
                scope["extensions"] = {**scope["extensions"], DIRECT: self}

        def data_received(self, data: bytes) -> None:
            message = self._short_message(data)
            if message is None:
                super().data_received(data)
                return
            if data[0] == _TEXT:
                self.on_text(message.decode("utf-8", "replace"))  # type: ignore[misc]
            else:
                self.on_bytes(message)  # type: ignore[misc]
            self._note_frames(1)

        def _short_message(self, data: bytes) -> bytes | None:
            """Return the message if `data` is exactly one frame with one short message.

            Return None if `data` is anything else, or if the parser still waits for the rest of an
            earlier frame or message.
            """
            size = len(data) - _HEAD_BYTES
            if not 0 <= size <= _SHORT_BYTES or data[1] != 0x80 | size:
                return None
            first, conn = data[0], self.conn
            if not ((first == _BINARY and self.on_bytes) or (first == _TEXT and self.on_text)):
                return None
            if conn.state is not State.OPEN or getattr(conn, "current_size", 0) is not None:
                return None
            step = conn.parser
            while (inner := getattr(step, "gi_yieldfrom", None)) is not None:
                step = inner
            if getattr(step, "__name__", "") != "at_eof":  # the parser is in the middle of a frame
                return None
            mask = (data[2:_HEAD_BYTES] * (size // 4 + 1))[:size]
            masked = int.from_bytes(data[_HEAD_BYTES:], "big")
            return (masked ^ int.from_bytes(mask, "big")).to_bytes(size, "big")

        def handle_bytes(self, event: Frame) -> None:
            if self.on_bytes is not None and event.fin:
                self.on_bytes(bytes(event.data))
            else:
                super().handle_bytes(event)

        def handle_text(self, event: Frame) -> None:
            if self.on_text is not None and event.fin:
                self.on_text(bytes(event.data).decode("utf-8", "replace"))
            else:
                super().handle_text(event)

        def handle_cont(self, event: Frame) -> None:
            super().handle_cont(event)
            # Join a message's fragments, so that an endless series of empty ones uses no memory.
            # Older versions of uvicorn join fragments by themselves.
            self.frames = [b"".join(getattr(self, "frames", ()))]

        def handle_events(self) -> None:
            n_frames = len(self.conn.events)
            super().handle_events()
            self._note_frames(n_frames)

        def _note_frames(self, n_frames: int) -> None:
            """Stop reading for a while if frames come faster than the limit."""
            now_s = self.loop.time()
            self._read_s = max(self._read_s, now_s - BURST_S) + n_frames * FRAME_S
            if self._read_s > now_s:
                self._is_held = True
                self.transport.pause_reading()
                self.loop.call_later(self._read_s - now_s, self._read_on)

        def _read_on(self) -> None:
            self._is_held = False
            if not self.read_paused:
                self.transport.resume_reading()

        async def receive(self) -> Any:
            message = await super().receive()
            if self._is_held:  # pause again, because uvicorn may have resumed reading
                self.transport.pause_reading()
            return message

        def shutdown(self) -> None:
            # On a closing connection, uvicorn's method would raise an error, and the app would not
            # be told to end.
            if not self.transport.is_closing():
                super().shutdown()

        def write_now(self, message: bytes) -> None:
            """Write a binary message, unless the websocket is closing."""
            if not self.close_sent and not self.transport.is_closing():
                before, frame = FastPathProtocol._written
                if before is not message:
                    frame = Frame(Opcode.BINARY, message).serialize(mask=False)
                    FastPathProtocol._written = message, frame
                self.transport.write(frame)

    return FastPathProtocol
