"""The wire: both ways, one byte of kind, four of length, then JSON or a picture. Pure."""

import json
import struct
from typing import Any, Dict, List, Tuple

PORT = 8765
PROTOCOL = 1
HEAD = struct.Struct(">cI")
PICTURE = struct.Struct(">IdHHB")
"""Frame id, taken_s on the brick's clock, width, height, encoding; then the bytes."""
ENCODINGS = ("yuyv", "jpeg")
LARGEST = {b"J": 16384, b"F": 4 << 20}


def pack_json(message: Dict[str, Any]) -> bytes:
    """Return a message as it goes over the wire."""
    body = json.dumps(message).encode()
    return HEAD.pack(b"J", len(body)) + body


class Unpacker:
    """Cuts a stream of bytes into (kind, body); ValueError on what cannot be one."""

    def __init__(self) -> None:
        self._waiting = bytearray()

    def feed(self, data: bytes) -> List[Tuple[bytes, bytes]]:
        """Add bytes, and return the messages that are now whole."""
        self._waiting += data
        messages = []
        while len(self._waiting) >= HEAD.size:
            kind, size = HEAD.unpack_from(self._waiting)
            if size > LARGEST.get(kind, -1):
                raise ValueError("not a message of this protocol")
            if len(self._waiting) < HEAD.size + size:
                break
            messages.append((kind, bytes(self._waiting[HEAD.size : HEAD.size + size])))
            del self._waiting[: HEAD.size + size]
        return messages


def prove(secret: str, nonce: str) -> str:
    """Answer a challenge: proof of knowing the secret without saying it."""
    import hmac  # here, since it loads OpenSSL, which a server on the brick never needs

    return hmac.new(secret.encode(), nonce.encode(), "sha256").hexdigest()
