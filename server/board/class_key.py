"""The class key: a secret that a teacher's board shares with the robots of a school class.

Each side proves that it knows the key without sending the key. A proof covers the random numbers of
both sides, and the robot's address as the prover sees it. An impostor at another address can
therefore neither replay nor relay the proof.
"""

from __future__ import annotations

import hmac
import os
import secrets
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from robot.errors import ConfigurationError, told_as
from robot.store.records import read_regular
from server.access.pairing import ALPHABET, TOKEN_LETTERS

SHORTEST = 32
"""Minimum length of a key in characters. The key must be long, because an attacker who has recorded
a handshake can try out keys without limit."""


@dataclass(frozen=True, slots=True)
class ClassKey:
    """The secret of one class."""

    secret: str = field(repr=False)

    def __post_init__(self) -> None:
        if len(self.secret) < SHORTEST or not self.secret.isascii():
            raise ConfigurationError(
                f"a class key needs at least {SHORTEST} letters and digits; `drivelesson board` "
                "makes a key if there is none"
            )

    def prove(self, who: str, board_nonce: str, robot_nonce: str, endpoint: str) -> str:
        """Return the proof that one side knows the key.

        Args:
            who: `robot` or `board`, so that neither side can use the other's proof.
            board_nonce: The board's random number.
            robot_nonce: The robot's random number, made for this `board_nonce`.
            endpoint: The robot's address and port, for example `192.168.1.5:8000`.
        """
        text = "\n".join(["drivelesson class 1", who, board_nonce, robot_nonce, endpoint])
        return hmac.digest(self.secret.encode(), text.encode(), "sha256").hex()

    @property
    def code(self) -> str:
        """The token for printed cards, which pairs any phone with any robot that has this key."""
        digest = hmac.digest(self.secret.encode(), b"drivelesson class code 1", "sha256")
        return "".join(ALPHABET[byte % len(ALPHABET)] for byte in digest[:TOKEN_LETTERS])

    def accepts(self, proof: str, who: str, board_nonce: str, robot_nonce: str, at: str) -> bool:
        """True if the other side has made this proof with the same key; see `prove`."""
        wanted = self.prove(who, board_nonce, robot_nonce, at)
        return hmac.compare_digest(wanted.encode(), proof.encode("utf-8", "replace"))


def new_nonce() -> str:
    return secrets.token_hex(16)


def endpoint(address: str, port: int) -> str:
    """Return the text that stands for a robot's address and port in a proof. The zone of an IPv6
    address is left out."""
    return f"{address.partition('%')[0].removeprefix('::ffff:').lower()}:{port}"


def read_class_key(file: Path) -> ClassKey:
    """Read a key; raises ConfigurationError if the file is missing or has no valid key."""
    wrong, do = f"cannot read the class key {file}", "copy it from the teacher's machine"
    with told_as(ConfigurationError, wrong, OSError, ValueError, do=do):
        text = read_regular(file, 4096).decode("ascii").strip()
    return ClassKey(text)


def keep_class_key(file: Path) -> ClassKey:
    """Read the key in a file. If there is no file, first create a file with a new key, which only
    the user can read. A full disk or a power cut may have left an empty file, which is replaced."""
    with told_as(ConfigurationError, f"cannot write class key {file}"), suppress(FileExistsError):
        file.parent.mkdir(parents=True, exist_ok=True)
        if file.is_file() and not file.stat().st_size:
            file.unlink()
        with os.fdopen(os.open(file, os.O_CREAT | os.O_WRONLY | os.O_EXCL, 0o600), "w") as out:
            out.write(secrets.token_urlsafe(32) + "\n")
    return read_class_key(file)
