"""The wire between an agent and its controller: framing, mutual proof, sealed messages. Pure.

A message is one byte of kind, four of length, then JSON or a picture. Both sides prove that they
know the shared secret (HMAC-SHA256 over both sides' nonces); from then on each message ends in a
MAC under a key of this connection and this direction, over a counter that both sides keep. So
nobody else can send, replay, drop or reorder messages, on this connection or a later one.
"""

import hmac
import json
import struct
from typing import Any, Dict, Iterator, Optional, Tuple

PORT = 8765
PROTOCOL = 2
HEAD = struct.Struct(">cI")
PICTURE = struct.Struct(">IdHHB")
"""Frame id, taken_s on the brick's clock, width, height, encoding; then the bytes."""
ENCODINGS = ("yuyv", "jpeg")
MAC_SIZE = 16
BEFORE_JOINING = {b"J": 1024}
"""The largest message of each kind: an unauthenticated client gets no more memory."""
FROM_CONTROLLER = {b"J": 16384}
FROM_AGENT = {b"J": 65536, b"F": 4 << 20}
_COUNT = struct.Struct(">Q")


def digest_of(secret: str, purpose: str, agent_nonce: str, controller_nonce: str) -> bytes:
    """Return 32 bytes for one purpose, which cannot be computed without the secret."""
    text = "\n".join(("drivelesson", purpose, agent_nonce, controller_nonce))
    return hmac.new(secret.encode(), text.encode(), "sha256").digest()


def prove(secret: str, side: str, agent_nonce: str, controller_nonce: str) -> str:
    """Return the proof of one side ("agent" or "controller") that it knows the secret."""
    return digest_of(secret, "proof of the " + side, agent_nonce, controller_nonce).hex()


def is_proof(
    given: object, secret: str, side: str, agent_nonce: str, controller_nonce: str
) -> bool:
    """True if the other side proved that it knows the secret; takes the same time either way."""
    wanted = prove(secret, side, agent_nonce, controller_nonce)
    return hmac.compare_digest(str(given).encode(), wanted.encode())


class Seal:
    """Computes the MAC of each message of one direction; counts them."""

    def __init__(self, secret: str, sender: str, agent_nonce: str, controller_nonce: str) -> None:
        key = digest_of(secret, "messages of the " + sender, agent_nonce, controller_nonce)
        self._keyed = hmac.new(key, None, "sha256")
        self._count = 0

    def mac(self, head: bytes, body: bytes) -> bytes:
        keyed = self._keyed.copy()
        keyed.update(_COUNT.pack(self._count))
        keyed.update(head)
        keyed.update(body)
        self._count += 1
        return keyed.digest()[:MAC_SIZE]


def pack(kind: bytes, body: bytes, seal: Optional[Seal] = None) -> bytes:
    """Return a message as it goes over the wire, sealed once both sides have proved themselves."""
    head = HEAD.pack(kind, len(body))
    return head + body + (seal.mac(head, body) if seal is not None else b"")


def pack_json(message: Dict[str, Any], seal: Optional[Seal] = None) -> bytes:
    return pack(b"J", json.dumps(message).encode(), seal)


class Unpacker:
    """Cuts a stream of bytes into messages. ValueError on what cannot be one.

    The kinds that may come, and how many bytes of each, are in `largest`.
    """

    def __init__(self, largest: Dict[bytes, int]) -> None:
        self._largest = largest
        self._seal = None  # type: Optional[Seal]
        self._waiting = bytearray()

    def expect_seal(self, seal: Seal, largest: Dict[bytes, int]) -> None:
        """From the next message on, accept only sealed ones."""
        self._seal = seal
        self._largest = largest

    def take(self, data: bytes) -> Iterator[Tuple[bytes, bytes]]:
        """Take in some bytes; yield the kind and the body of each message that is whole."""
        self._waiting += data
        while len(self._waiting) >= HEAD.size:
            kind, size = HEAD.unpack_from(self._waiting)
            if size > self._largest.get(kind, -1):
                raise ValueError("not a message of this protocol")
            end = HEAD.size + size + (MAC_SIZE if self._seal is not None else 0)
            if len(self._waiting) < end:
                return
            whole, rest = bytes(self._waiting[:end]), HEAD.size + size
            del self._waiting[:end]
            head, body, mac = whole[: HEAD.size], whole[HEAD.size : rest], whole[rest:]
            if self._seal is not None and not hmac.compare_digest(mac, self._seal.mac(head, body)):
                raise ValueError("a message that was changed, repeated or sent by somebody else")
            yield kind, body
