"""Pairing of browsers: a browser exchanges a one-time token for a session with a role.

Only hashes of sessions are stored, in memory and in one small file. Nothing here uses HTTP; the
time is an argument.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import logging
import os
import re
import secrets
import unicodedata
from collections import OrderedDict, deque
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote

from robot.entry_points import points
from robot.errors import UNREADABLE
from robot.store.folder import FolderKind
from robot.store.presence import require_present
from robot.store.records import read_regular
from server.access.config import NetworkConfig
from server.access.rate_limits import RateLimits
from server.gateway.roles import Refusal, Role, Session

log = logging.getLogger(__name__)

ALPHABET = "23456789ABCDEFGHJKMNPQRSTVWXYZ"
"""The characters of a token; letters and digits that look alike are left out."""
TOKEN_LETTERS, _GROUP = 16, 4  # 16 letters of an alphabet of 30 have 78 bits
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
"""Colour codes of a terminal, which some terminals and pagers copy with the text."""
_TOKEN = re.compile(
    rf"(?<![^\W_])(?:[{ALPHABET}]{{{_GROUP}}}[\W_]{{0,3}}){{{TOKEN_LETTERS // _GROUP}}}(?![^\W_])"
)
ROLES = "drivelesson.roles"
"""Group of the entry points by which extensions add roles that browsers can get."""
FOLDER = FolderKind(name="tls", files=("paired.json",), secrets=("paired.json", "tls/", "*.key"))
"""The files of this extension in the data folder."""
LONGEST_TEXT = 2000
"""Maximum length of the text read as a token, in characters; the text may be a whole address."""
_SESSIONS = 192
"""Maximum number of sessions with the same role that were paired in the same way (by the terminal
or by a class's board). There are more sessions than websockets, so not all sessions can be in
use."""
INVITATION_S = 300.0
"""Time for which a token on a class's board is valid, for any number of phones, in seconds."""
_INVITATIONS = 16


@cache
def browser_roles() -> tuple[Role, ...]:
    """Return the roles that a browser can get by pairing; those of extensions come last."""
    return Role.VIEWER, Role.PILOT, *(role for p in points(ROLES) if (role := p.load()).purpose)


class Paired(NamedTuple):
    """A paired browser: its role, and the secret in its cookie."""

    role: Role
    secret: str
    is_kept: bool = True
    """True if the browser stays paired after a restart of the server."""


class _Kind(NamedTuple):
    """The role of a paired browser, and how the browser was paired."""

    role: Role
    invited: bool = False
    """True if paired through the board of a class, False if by a code from the terminal."""
    owner: bool = False
    """True for the first pilot that the terminal paired."""


Sessions = Mapping[str, _Kind]
"""Sessions by the hash of their secret."""


def cookie_name(config: NetworkConfig) -> str:
    """Return the name of the session cookie.

    The name contains the public address, or the port if there is none: browsers send a cookie to
    all ports of a host, so each robot on a host needs its own name. The prefix of the name makes
    browsers reject a cookie set without TLS or for another path.
    """
    public = config.public[0] if config.public else None
    place = re.sub(r"\W+", "-", f"{public.host}{public.prefix}") if public else config.port
    has_path = any(public.prefix for public in config.public)
    kind = "" if not config.is_secure else "__Secure-" if has_path else "__Host-"
    return f"{kind}drivelesson-{place}"


class Pairing:
    """The tokens that can be redeemed now, and the sessions of paired browsers.

    Args:
        failures_a_minute: Number of wrong tokens per minute before an address has to wait.
        file: The file with the sessions; None to lose the sessions at a restart.
        on_token: Called with each new token and its role, so that the terminal can show the token.

    Attributes:
        is_in_use: Returns True if a browser of the session with the given name is connected now.
        standing_code: A printed code that pairs any number of browsers as pilots, or None.
    """

    def __init__(
        self,
        failures_a_minute: int,
        file: Path | None = None,
        on_token: Callable[[Role, str], None] = lambda role, token: None,
    ) -> None:
        self._failures_a_minute = failures_a_minute
        self._failures = RateLimits()
        self._file = file
        self._on_token = on_token
        self._sessions: OrderedDict[str, _Kind] = _load(file) if file else OrderedDict()
        """Sessions by the hash of their secret. Sessions that are unused since the start come
        first, then the others in the order of their first use."""
        self._unused = set(self._sessions)
        """Sessions that no browser has used since the server started; they are evicted first."""
        self._is_saved = file is not None
        """True if the sessions' file is up to date; if not, a later pairing writes it."""
        self.is_in_use: Callable[[str], bool] = lambda name: False
        self.tokens: dict[Role, str] = {role: _new_token() for role in browser_roles()}
        self._invitations: deque[tuple[str, float]] = deque(maxlen=_INVITATIONS)
        self.standing_code: str | None = None

    def redeem(
        self, token: str, now_s: float, address: str = "", secret: str = ""
    ) -> Paired | Refusal:
        """Exchange a token for a session. Each token works once and is then replaced.

        Args:
            token: The text that contains the token; see `token_in`.
            now_s: The time in seconds.
            address: The address from which wrong tokens are counted.
            secret: The secret of the browser's existing session. If the role changes, the new
                session replaces that one.

        The right token is accepted even after too many wrong ones from the same address, so that
        nobody can lock others out. Guessing is hopeless: a token has 78 random bits.
        """
        given = token_in(token)
        for role, wanted in self.tokens.items():
            if hmac.compare_digest(given.encode(), wanted.replace("-", "").encode()):
                paired = self._pair(_Kind(role=role), secret)
                self.tokens[role] = _new_token()
                self._on_token(role, self.tokens[role])
                return paired
        codes = [code for code, until_s in self._invitations if now_s < until_s]
        codes += [self.standing_code] if self.standing_code is not None else []
        if any(hmac.compare_digest(given, code) for code in codes):
            return self._pair(_Kind(role=Role.PILOT, invited=True), secret)
        most = self._failures_a_minute
        if not self._failures.allows(address, now_s, per_second=most / 60, burst=most):
            sentence = "Too many wrong tokens. Wait a minute and try again."
            return Refusal(429, "pairing_rate", sentence)
        log.warning("pairing refused")
        sentence = "That token is wrong or was used before. The robot's terminal shows a valid one."
        return Refusal(403, "pairing", sentence)

    def invite(self, now_s: float) -> tuple[str, float]:
        """Return a new token that pairs any number of pilots, and how long it is valid, in seconds.

        A class's board shows it as a QR code that several phones can scan.
        """
        token = _new_token()
        self._invitations.append((token.replace("-", ""), now_s + INVITATION_S))
        return token, INVITATION_S

    def find(self, secret: str) -> Session | None:
        """Return the session with this secret; None if there is none."""
        name = hash_of(secret)
        kind = self._sessions.get(name)
        if kind is None:
            return None
        if name in self._unused:  # save the order of use, so that it survives a restart
            self._unused.discard(name)
            self._sessions.move_to_end(name)
            self._save()
        return Session(kind.role, name)

    def sign_out_invited(self) -> Sessions:
        """End the sessions that the board of a class has paired. Return them, so that `sign_in` can
        restore them."""
        ended = {name: kind for name, kind in self._sessions.items() if kind.invited}
        for name in ended:
            del self._sessions[name]
        self._unused -= ended.keys()
        self._save()
        return ended

    def sign_in(self, sessions: Sessions) -> None:
        """Restore sessions that `sign_out_invited` has ended."""
        self._sessions = OrderedDict({**sessions, **self._sessions})
        self._save()

    def is_owner(self, name: str) -> bool:
        """True for the session of the first pilot that the terminal paired."""
        return name in self._sessions and self._sessions[name].owner

    def forget(self, secret: str) -> bool:
        """End a session.

        Returns:
            False if the file could not be written; a restart would then restore the session.
        """
        known = self._sessions.pop(hash_of(secret), None)
        return self._save() if known is not None else self._is_saved or self._save()

    def _pair(self, kind: _Kind, before: str) -> Paired | Refusal:
        known = self._sessions.get(hash_of(before))
        if known is not None and known.role is kind.role and (kind.invited or not known.invited):
            return Paired(kind.role, before, self._is_saved or self._save())
        if not kind.invited and kind.role is Role.PILOT:
            has_owner = any(one.owner for one in self._sessions.values())
            kind = kind._replace(owner=not has_owner)
        same = [name for name, one in self._sessions.items() if one == kind]
        if len(same) >= _SESSIONS:
            idle = [name for name in same if not self.is_in_use(name)]
            if not idle:
                return Refusal(503, "sessions", "Too many browsers are connected.")
            # If every idle session was used in this run, evict the newest. A client that redeems
            # many codes can then only evict its own sessions.
            del self._sessions[next((name for name in idle if name in self._unused), idle[-1])]
        self._sessions.pop(hash_of(before), None)
        secret = secrets.token_urlsafe(32)
        self._sessions[hash_of(secret)] = kind
        self._unused = (self._unused & self._sessions.keys()) | {hash_of(secret)}
        self._sessions.move_to_end(hash_of(secret), last=False)
        is_kept = self._save()
        log.info("paired role=%s", kind.role.value)
        return Paired(role=kind.role, secret=secret, is_kept=is_kept)

    def _save(self) -> bool:
        """Write all sessions to the file; return False if that fails or there is no file."""
        if self._file is None:
            return False
        self._is_saved = False
        rows = [
            {"sha256": name, **kind._asdict(), "role": kind.role.value}
            for name, kind in self._sessions.items()
        ]
        new = self._file.with_suffix(".new")
        try:
            require_present(self._file)
            self._file.parent.mkdir(parents=True, exist_ok=True)
            with os.fdopen(os.open(new, os.O_CREAT | os.O_WRONLY | os.O_TRUNC, 0o600), "w") as out:
                out.write(json.dumps({"sessions": rows}))  # json.dump is slower
            new.replace(self._file)
        except OSError as error:
            log.warning("pairing not saved file=%s error=%r", self._file, str(error))
            return False
        self._is_saved = True
        return True


def _load(file: Path) -> OrderedDict[str, _Kind]:
    found = OrderedDict[str, _Kind]()
    roles = {role.value: role for role in browser_roles()}
    try:
        for row in json.loads(read_regular(file, 1 << 20))["sessions"]:
            role = roles[row["role"]]
            invited, owner = row.get("invited") is True, row.get("owner") is True
            found[str(row["sha256"])] = _Kind(role=role, invited=invited, owner=owner)
    except FileNotFoundError:
        pass
    except (OSError, *UNREADABLE) as error:
        log.warning("pairing file unreadable, pair browsers again file=%s error=%r", file, error)
        found.clear()
    return found


def hash_of(secret: str) -> str:
    """Return the SHA-256 hash of a secret.

    A slow password hash is not needed, because nobody can guess a secret of 256 random bits.
    """
    return hashlib.sha256(secret.encode("utf-8", "replace")).hexdigest()


def token_in(text: str) -> str:
    """Return the letters of the token in a text that a person pastes or types.

    The text may be the token, the pairing address, or lines of the terminal. Hyphens, case,
    full-width letters, colour codes and an encoded `#` make no difference. If the text has several
    addresses, the first counts.

    Example:
        >>> token_in("or open http://robot.local:8000/pair%23abcd-efgh-jkmn-pqrs")
        'ABCDEFGHJKMNPQRS'
    """
    plain = unicodedata.normalize("NFKC", _COLOURS.sub("", text[:LONGEST_TEXT]))
    before, *parts = unquote(unquote(plain)).upper().split("#")
    found = next(filter(None, map(_TOKEN.search, [*parts, before])), None)
    letters = found[0] if found else (parts or [before])[-1]
    return "".join(letter for letter in letters if letter in ALPHABET)[:TOKEN_LETTERS]


def _new_token() -> str:
    letters = "".join(secrets.choice(ALPHABET) for _ in range(TOKEN_LETTERS))
    return "-".join(letters[i : i + _GROUP] for i in range(0, TOKEN_LETTERS, _GROUP))
