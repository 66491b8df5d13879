"""The robot's side of a school class: the sessions of the teacher's board, and the locks that
forbid pupils some changes.

A robot has a `Classroom` only if it was started with the class's key. The teacher's board proves
that it knows the key and gets a session. Its requests carry the session's secret in a header, which
no page of another site can set. The robot stores the locks, and its guard enforces them. Apart from
the file with the locks, the module does no input or output; callers pass it the time.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import logging
import re
import secrets
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from robot.errors import ConfigurationError
from robot.store.folder import write_whole
from robot.store.records import read_regular
from server.access.pairing import hash_of
from server.board.class_key import ClassKey
from server.gateway.roles import Role

log = logging.getLogger(__name__)

TEACHER = Role(value="teacher", may_change=True, holds_stop=True)
"""The role of a class's board. The board may change everything that a pilot may change, and may set
locks. The board may not drive."""
LOCKS: dict[str, tuple[str, ...]] = {
    "settings": ("/api/settings", "/api/world"),
    "models": ("/api/models", "/api/retraining", "/api/studies", "/api/session"),
    "gallery": ("/api/gallery",),
    "recordings": ("/api/episodes",),
}
"""The locks that a teacher can set. Each lock forbids changes at its paths and below them."""
_SERIAL = Path("/sys/firmware/devicetree/base/serial-number")
_NONCE = re.compile(r"[0-9a-f]{32}")
_READS = ("GET", "HEAD", None)
_SESSIONS = 8
_CHALLENGE_S = 10.0
_USED = 64


class Classroom:
    """The teacher's sessions, the locks and the id of one robot; locks and id are saved if there is
    a file.

    Attributes:
        id: Stays the same when the robot restarts or its address changes, so that the board
            recognises the robot. Without a file, the id is new at each start.
        run: A random text that is new at each start.
    """

    def __init__(self, key: ClassKey, file: Path | None = None) -> None:
        self._key = key
        self.code = key.code
        self._file = file
        self._own_secret = secrets.token_bytes(32)
        self._sessions: deque[str] = deque(maxlen=_SESSIONS)
        self._used: deque[str] = deque(maxlen=_USED)
        self.run = secrets.token_hex(8)
        self.locks, saved = _load(file)
        self._saved_id = saved or secrets.token_hex(8)
        text = f"{self._saved_id} {_board_serial()}".encode()
        self.id = hashlib.sha256(text).hexdigest()[:16]
        if saved is None:
            try:
                self._write(self.locks)
            except OSError as error:  # the robot can start although its id is not saved
                log.warning("the robot's id was not saved: %s", error)

    def challenge(self, board_nonce: str, endpoint: str, now_s: float) -> tuple[str, str]:
        """Return a random number for the board, and the proof that this robot knows the key.

        Nothing is stored, so that a flood of requests uses no memory. Raises ConfigurationError if
        `board_nonce` is not valid.
        """
        if not _NONCE.fullmatch(board_nonce):
            raise ConfigurationError("'nonce' must be 32 hexadecimal digits")
        opened = f"{round(now_s * 1000):x}.{secrets.token_hex(16)}"
        nonce = f"{opened}.{self._seal(opened, board_nonce)}"
        return nonce, self._key.prove("robot", board_nonce, nonce, endpoint)

    def admit(
        self, board_nonce: str, nonce: str, proof: str, endpoint: str, now_s: float
    ) -> str | None:
        """Return the secret of a new session if the board knows the key, otherwise None."""
        if not self._is_ours(nonce, board_nonce, now_s) or nonce in self._used:
            return None
        if not self._key.accepts(proof, "board", board_nonce, nonce, endpoint):
            log.warning("class join refused")
            return None
        self._used.append(nonce)
        secret = secrets.token_urlsafe(32)
        self._sessions.append(hash_of(secret))
        log.info("class joined")
        return secret

    def knows(self, authorization: str) -> bool:
        """True if the value of an Authorization header has the secret of a teacher's session."""
        kind, _, secret = authorization.partition(" ")
        return kind == "Bearer" and hash_of(secret) in self._sessions

    def _is_ours(self, nonce: str, board_nonce: str, now_s: float) -> bool:
        opened, _, seal = nonce.rpartition(".")
        wanted = self._seal(opened, board_nonce)
        if not hmac.compare_digest(wanted.encode(), seal.encode("utf-8", "replace")):
            return False
        return 0 <= now_s - int(opened.partition(".")[0], 16) / 1000 + 0.001 <= _CHALLENGE_S

    def _seal(self, opened: str, board_nonce: str) -> str:
        text = f"{opened} {board_nonce}".encode("utf-8", "replace")
        return hmac.new(self._own_secret, text, hashlib.sha256).hexdigest()[:32]

    def lock(self, names: Sequence[str]) -> None:
        """Replace the locks by those in `names`; if an error is raised, the old locks remain."""
        locks = frozenset(names)
        if not locks <= LOCKS.keys():
            raise ConfigurationError(f"'locks' may contain only these: {', '.join(LOCKS)}")
        self._write(locks)
        self.locks = locks

    def _write(self, locks: frozenset[str]) -> None:
        if self._file is not None:
            saved = {"locks": sorted(locks), "id": self._saved_id}
            write_whole(self._file, json.dumps(saved).encode())

    def is_locked(self, path: str, method: str | None) -> bool:
        """True if a lock forbids such a request to everybody except the teacher."""
        return method not in _READS and any(
            path == prefix or path.startswith(prefix + "/")
            for name in self.locks
            for prefix in LOCKS[name]
        )


def _load(file: Path | None) -> tuple[frozenset[str], str | None]:
    """Read the locks and the id; the id is None if there is none yet. If the file is damaged, the
    id is empty, and everything is locked until the teacher unlocks it."""
    if file is None:
        return frozenset(), None
    try:
        saved = json.loads(read_regular(file, 1 << 16))
        locks = frozenset(str(name) for name in saved["locks"]) & frozenset(LOCKS)
        return locks, str(saved["id"]) if "id" in saved else None
    except FileNotFoundError:
        return frozenset(), None
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        log.warning("locks unreadable, everything is locked file=%s error=%r", file, str(error))
        return frozenset(LOCKS), ""


def _board_serial() -> str:
    """Return the serial number of a single-board computer, or an empty text. The number
    distinguishes robots whose SD cards are copies of one card."""
    with suppress(OSError):
        return read_regular(_SERIAL, 256).decode("ascii", "replace")
    return ""
