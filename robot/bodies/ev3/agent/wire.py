"""The wire format between an agent and its controller: framing, mutual proof, sealed messages.
Pure.

A message consists of one byte for its kind, four bytes for its length, and JSON or a picture. Agent
and controller prove that they know the shared secret, by an HMAC-SHA256 over the nonces of both.
After both proofs each message ends in a message authentication code (MAC); each connection and
direction has its own key. The MAC covers the message and a counter that both sides keep. Nobody
else can therefore send, replay, drop or reorder messages unnoticed.
"""

import hmac
import json
import struct
from typing import Any, Dict, Iterator, Optional, Tuple

PORT = 8765
PROTOCOL = 2
HEAD = struct.Struct(">cI")
PICTURE = struct.Struct(">IdHHB")
"""Head of a picture's message: frame id, taken_s on the brick's clock, width, height, encoding. The
picture's bytes follow."""
ENCODINGS = ("yuyv", "jpeg")
MAC_SIZE = 16
BEFORE_JOINING = {b"J": 1024}
"""Maximum length of each kind of message before joining. It limits the memory that an
unauthenticated client can use."""
FROM_CONTROLLER = {b"J": 16384}
FROM_AGENT = {b"J": 65536, b"F": 4 << 20}
_COUNT = struct.Struct(">Q")


def digest_of(secret: str, purpose: str, agent_nonce: str, controller_nonce: str) -> bytes:
    """Return a digest of 32 bytes, different for each purpose, that nobody can compute without the
    secret."""
    text = "\n".join(("drivelesson", purpose, agent_nonce, controller_nonce))
    return hmac.new(secret.encode(), text.encode(), "sha256").digest()


def prove(secret: str, side: str, agent_nonce: str, controller_nonce: str) -> str:
    """Return the proof of one side ("agent" or "controller") that it knows the secret."""
    return digest_of(secret, "proof of the " + side, agent_nonce, controller_nonce).hex()


def is_proof(
    given: object, secret: str, side: str, agent_nonce: str, controller_nonce: str
) -> bool:
    """True if `given` proves that the other side knows the secret; compares in constant time."""
    wanted = prove(secret, side, agent_nonce, controller_nonce)
    return hmac.compare_digest(str(given).encode(), wanted.encode())


class Seal:
    """Computes the MACs of the messages of one direction, and counts the messages."""

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
    """Return an encoded message, which ends in a MAC if `seal` is given."""
    head = HEAD.pack(kind, len(body))
    return head + body + (seal.mac(head, body) if seal is not None else b"")


def pack_json(message: Dict[str, Any], seal: Optional[Seal] = None) -> bytes:
    return pack(b"J", json.dumps(message).encode(), seal)


class Unpacker:
    """Splits a stream of bytes into messages; raises ValueError if a message is invalid.

    `largest` contains the accepted kinds, each with its maximum length.
    """

    def __init__(self, largest: Dict[bytes, int]) -> None:
        self._largest = largest
        self._seal = None  # type: Optional[Seal]
        self._waiting = bytearray()

    def expect_seal(self, seal: Seal, largest: Dict[bytes, int]) -> None:
        """Accept only sealed messages from now on."""
        self._seal = seal
        self._largest = largest

    def take(self, data: bytes) -> Iterator[Tuple[bytes, bytes]]:
        """Add received bytes; yield the kind and the body of each complete message."""
        self._waiting += data
        while len(self._waiting) >= HEAD.size:
            kind, size = HEAD.unpack_from(self._waiting)
            if size > self._largest.get(kind, -1):
                raise ValueError("this is not a message of the agent's protocol")
            end = HEAD.size + size + (MAC_SIZE if self._seal is not None else 0)
            if len(self._waiting) < end:
                return
            whole, rest = bytes(self._waiting[:end]), HEAD.size + size
            del self._waiting[:end]
            head, body, mac = whole[: HEAD.size], whole[HEAD.size : rest], whole[rest:]
            if self._seal is not None and not hmac.compare_digest(mac, self._seal.mac(head, body)):
                raise ValueError("a message has an invalid MAC: it was changed, repeated or forged")
            yield kind, body
