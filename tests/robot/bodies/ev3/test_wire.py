"""The wire protocol frames, seals and refuses messages, without sockets."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.bodies.ev3.agent import wire

NONCES = ("a" * 32, "b" * 32)
LIMITS = {b"J": 64, b"F": 256}


def sealed(n: int) -> list[bytes]:
    seal = wire.Seal("a secret", "controller", *NONCES)
    return [wire.pack(b"J", b"%d" % index, seal) for index in range(n)]


def opened(data: bytes) -> list[bytes]:
    """Return the accepted bodies; ValueError if a message is refused."""
    unpacker = wire.Unpacker(LIMITS)
    unpacker.expect_seal(wire.Seal("a secret", "controller", *NONCES), LIMITS)
    return [body for _, body in unpacker.take(data)]


@given(st.lists(st.binary(max_size=64), max_size=5), st.lists(st.integers(1, 40), max_size=30))
def test_messages_are_the_same_however_the_bytes_are_split(
    bodies: list[bytes], cuts: list[int]
) -> None:
    stream = b"".join(wire.pack(b"J", body) for body in bodies)
    unpacker = wire.Unpacker(LIMITS)
    got = []
    for cut in [*cuts, len(stream)]:
        got += [body for _, body in unpacker.take(stream[:cut])]
        stream = stream[cut:]
    assert got == bodies


@given(st.integers(0, 2), st.integers(0, 10**6), st.integers(1, 255))
def test_no_changed_bit_is_accepted(which: int, where: int, flip: int) -> None:
    messages = [bytearray(message) for message in sealed(3)]
    messages[which][where % len(messages[which])] ^= flip
    stream = b"".join(bytes(message) for message in messages)
    try:
        accepted = opened(stream)
    except ValueError:
        return
    # A message with a larger length may wait for more bytes, but is never accepted.
    assert accepted == [b"%d" % index for index in range(which)]


@given(st.permutations(range(4)), st.integers(1, 4))
def test_repeated_missing_or_reordered_messages_are_refused(order: list[int], n: int) -> None:
    messages = sealed(4)
    assert opened(b"".join(messages)) == [b"0", b"1", b"2", b"3"]
    chosen = order[:n]
    stream = b"".join(messages[index] for index in [*chosen, chosen[0]])
    with pytest.raises(ValueError, match="changed, repeated or forged"):
        opened(stream)


@pytest.mark.parametrize(
    "other",
    [
        ("another secret", "controller", *NONCES),
        ("a secret", "agent", *NONCES),
        ("a secret", "controller", NONCES[0], "c" * 32),
    ],
    ids=["another secret", "the other direction", "another connection"],
)
def test_a_message_cannot_be_opened_with_another_key(other: tuple[str, str, str, str]) -> None:
    with pytest.raises(ValueError, match="changed, repeated or forged"):
        opened(wire.pack(b"J", b"0", wire.Seal(*other)))


def test_a_proof_is_valid_only_for_its_nonces() -> None:
    proof = wire.prove("a secret", "agent", *NONCES)
    assert wire.is_proof(proof, "a secret", "agent", *NONCES)
    for given_proof, secret, side, nonces in (
        (proof, "a secret", "controller", NONCES),
        (proof, "another", "agent", NONCES),
        (proof, "a secret", "agent", NONCES[::-1]),
        (None, "a secret", "agent", NONCES),
        ("é" * 64, "a secret", "agent", NONCES),
    ):
        assert not wire.is_proof(given_proof, secret, side, *nonces)


@pytest.mark.parametrize("kind", [b"J", b"F", b"G"])
def test_an_oversized_message_is_refused_before_it_has_arrived(kind: bytes) -> None:
    unpacker = wire.Unpacker(wire.BEFORE_JOINING)
    with pytest.raises(ValueError, match="not a message"):
        list(unpacker.take(wire.HEAD.pack(kind, 1025)))
