"""Access rules: Host, Origin and role of a request.

On loopback every client is admitted as a pilot, but Host and Origin are checked even there: a page
of another site, open in the same browser, must not reach the robot by cross-site websockets or by
DNS rebinding. On a local network only paired browsers are admitted.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol
from urllib.parse import urlsplit

from starlette.requests import cookie_parser

from server.config import PublicAddress, as_address

PUBLIC_PATHS = frozenset(
    {
        "/pair",
        "/api/pair",
        "/js/pair.js",
        "/css/pair.css",
        "/healthz",
        "/api/class/hello",
        "/api/class/join",
        "/ca.crt",
        "/favicon.ico",
        "/manifest.webmanifest",
    }
)
"""What a browser needs before it is paired; none of it tells anything about the robot."""

EYE_PATHS = re.compile(r"/eye|/ws/eye|/api/unpair|/(js|css|icons)/.*")
"""All that the phone on the robot may request. It lies there unattended, so that is little."""

_READING = ("GET", "HEAD", None)
"""Methods that change nothing; None is a websocket's, which checks for itself."""
_VIEWERS_PATHS = PUBLIC_PATHS | {"/api/unpair"}
"""What who only watches may change; to stop is everybody's."""
ONLY_PILOTS = "This browser may watch; only a pilot may change things."
_COOKIES = re.compile(rb"\r\ncookie:([^\r]*)\r\n", re.I)


class Role(StrEnum):
    """What a client may do."""

    VIEWER = "viewer"
    PILOT = "pilot"
    EYE = "eye"
    TEACHER = "teacher"
    """The board of a class: changes what a pilot may and what is locked, and never drives."""


PAIRED = (Role.VIEWER, Role.PILOT, Role.EYE)
"""What a browser can be paired as."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """The answer to a refused request."""

    status: int
    reason: str
    """Short name for logs and metrics."""
    sentence: str
    """Text for the person."""
    location: str | None = None
    """Address to redirect to."""
    open_at: tuple[str, ...] = ()
    """Addresses of the page, for who came by a name that is not known."""


@dataclass(frozen=True, slots=True)
class Session:
    """A client: what it may do, and what it is counted by."""

    role: Role
    name: str
    """Of a paired browser that of its session, and else the address."""
    is_crowd: bool = False
    """The address of a server without pairing, or of a proxy: many people may be behind it."""


class Members(Protocol):
    """Teachers and locks: `server.board.classroom.Classroom`."""

    def knows(self, authorization: str) -> bool:
        """True if the header carries the secret of a teacher's session."""
        ...

    def is_locked(self, path: str, method: str | None) -> bool: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Access:
    """The rules of one server.

    Args:
        names: Names that the robot answers to; they may change while it serves.
        addresses: Returns where people open the page now, for who came by another name.
        allows_addresses: Accept any IP address as Host too: DNS rebinding needs a name.
        find_session: Returns the session of a secret; None where every client is admitted.
        cookie: Name of the cookie that carries the session.
        members: The class that the robot belongs to; None for a robot in no class.
        public: Where people open the page that a proxy serves.
    """

    names: Container[str]
    addresses: Callable[[], Sequence[str]] = tuple
    allows_addresses: bool = False
    find_session: Callable[[str], Session | None] | None = None
    cookie: str = ""
    members: Members | None = None
    public: tuple[PublicAddress, ...] = ()

    def check_host(self, headers: Mapping[str, str]) -> Refusal | None:
        """Refuse a request whose Host is another name: DNS rebinding."""
        host = headers.get("host", "")
        name = host_name(host)
        if name in self.names or (self.allows_addresses and as_address(name) is not None):
            return None
        open_at = list(self.addresses())
        where = f" Open it by its address: {open_at[0]}." if open_at else ""
        sentence = (
            f"This robot does not answer to {_short(host)}.{where} If this is its name, start it "
            f"with --also-at {_short(name)}. {_behind(f'http://{host}')}"
        )
        return Refusal(421, "host", sentence, open_at=tuple(open_at))

    def check_origin(
        self, headers: Mapping[str, str], scheme: str, method: str | None
    ) -> Refusal | None:
        """Refuse a request that a page of another site has sent.

        A page cannot forge these headers; programs that are no browsers send neither, and could
        send anything. `method` is the request's, None for a websocket.
        """
        origin, host = headers.get("origin"), headers.get("host", "")
        if origin is not None:
            if origin in (f"{scheme}://{host}", *(public.origin for public in self.public)):
                return None
            told = f"Origin is {_short(origin)}, but it was asked as {_short(f'{scheme}://{host}')}"
            return _cross_site(f"{told}. {_behind(origin)}")
        site = headers.get("sec-fetch-site", "none")
        # A person followed a link: that may open the page, but not frame it.
        is_link = method in ("GET", "HEAD") and headers.get("sec-fetch-mode") == "navigate"
        if site in ("none", "same-origin") or is_link:
            return None
        return _cross_site(f"Sec-Fetch-Site is {_short(site)}.")

    def session_of(self, headers: Mapping[str, str], address: str) -> Session | None:
        """Return the session of a request; None for an unpaired browser."""
        if self.members is not None and self.members.knows(headers.get("authorization", "")):
            return Session(Role.TEACHER, Role.TEACHER)  # all boards are counted as one
        if self.find_session is None:
            return Session(Role.PILOT, address, is_crowd=True)
        return self.find_session(cookie_parser(headers.get("cookie", "")).get(self.cookie, ""))

    def session_in(self, head: bytes) -> Session | None:
        """Return the session in the first bytes of a request; None if none is to be seen there."""
        found = _COOKIES.search(head)
        if self.find_session is None or found is None:
            return None
        return self.find_session(cookie_parser(found[1].decode("latin-1")).get(self.cookie, ""))

    def admit(
        self, path: str, method: str | None, headers: Mapping[str, str], session: Session | None
    ) -> Role | Refusal:
        is_public = path in PUBLIC_PATHS or path.startswith("/pair#")
        role = session.role if session else Role.VIEWER
        location: str | None = None
        if not session and not is_public:
            status, reason, location = 401, "unpaired", "/pair"
            why = "This browser is not paired. Open the address that the robot's terminal shows."
        elif role is Role.EYE and not (is_public or EYE_PATHS.fullmatch(path)):
            status, reason, location = 403, "role", "/eye"
            why = "This phone is the robot's eye; it may see and stop, not drive."
        elif role is Role.VIEWER and method not in _READING and path not in _VIEWERS_PATHS:
            status, reason, why = 403, "role", ONLY_PILOTS
        elif role is not Role.TEACHER and self.members and self.members.is_locked(path, method):
            status, reason, why = 423, "locked", "The teacher has locked this."
        else:
            return role
        if location and "text/html" in headers.get("accept", ""):
            status = 303
        return Refusal(status, reason, why, location if status == 303 else None)


def host_name(host: str) -> str:
    """Return the name in a Host header: without port, in lower case; empty if not valid."""
    try:
        return (urlsplit(f"//{host}").hostname or "").rstrip(".")
    except ValueError:
        return ""


def _cross_site(why: str) -> Refusal:
    return Refusal(403, "origin", f"A page of another site has sent this request: {why}")


def _behind(address: str) -> str:
    return f"If a proxy has passed this on, start the robot with --behind-proxy {_short(address)}"


def _short(text: str) -> str:
    """Return what a client has sent as one word to be shown."""
    return re.sub(r"[^!-~]", "?", text)[:80]
