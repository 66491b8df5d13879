"""Decides which connections and requests reach the application.

This gateway serves only this computer. For networks, the extension `access` has another gateway,
which admits only browsers that it can identify (entry point `drivelesson.gateway`).
"""

from __future__ import annotations

import argparse
import contextlib
import socket
import ssl
from collections import Counter
from collections.abc import Callable, Container, Mapping, Sequence
from typing import Any, ClassVar

from starlette.responses import JSONResponse, Response
from starlette.types import Scope

from robot.clock import Clock
from robot.entry_points import points
from server.config import Config, Limits
from server.gateway.roles import Refusal, Role, Session

GATEWAY = "drivelesson.gateway"
STOP_PATH = "/api/stop"
"""The path by which a page without a websocket sends the emergency stop."""
SLOT = "drivelesson.slot"
"""Key in a scope: the slot that a limited websocket, stream or upload has taken."""
PREFIX = "drivelesson.prefix"
"""Key in a scope: the path under which the page is served, such as /robot; empty for the root."""
READING = ("GET", "HEAD", None)
"""Methods that change nothing. None stands for a websocket, whose messages are checked later."""
Credential = Callable[[Mapping[str, str]], Session | None]
Check = Callable[[str, str | None, Role], Refusal | None]


class Gateway:
    """Admits all clients of this computer as pilots. Extensions add credentials, checks and paths.

    Attributes:
        credentials: Functions that return the session that a request's headers prove, or None.
        checks: Functions that may refuse a request by path, method (None: websocket) and role.
        protected: Names of sessions whose connections are never closed to make room for others.
        has_priority: Returns True for the name of the pilot's session, which is also protected.
        public_paths: Paths that need no session and reveal nothing about the robot.
        open_paths: Paths on which a viewer may do more than read.
        refused: The number of refused requests, by reason.
    """

    limits_type: ClassVar[type[Limits]] = Limits
    is_tls = False
    """True if the page is served by https. `open` then sets `tls_files`."""
    tls_files: tuple[str, str] | None = None
    """The files of the server's private key and TLS chain; None without https."""
    allows_addresses = False
    """True if any IP address is accepted as Host. (DNS rebinding attacks work only with names.)"""
    origins: tuple[str, ...] = ()
    """Other origins of the robot's page, if a proxy serves the page."""
    not_admitted = Refusal(401, "session", "This browser is not admitted.")
    """The refusal for a client without a session."""

    def __init__(self, config: Config, clock: Clock) -> None:
        self.config, self.clock = config, clock
        self.credentials: list[Credential] = []
        self.checks: list[Check] = []
        self.protected: set[str] = set()
        self.has_priority: Callable[[str], bool] = lambda person: False
        self.public_paths = {"/healthz", "/favicon.ico", "/manifest.webmanifest"}
        self.open_paths: set[str] = set()
        self.refused: Counter[str] = Counter()

    @classmethod
    def configure(cls, parser: argparse.ArgumentParser) -> None:
        """Declare options of `drivelesson serve`."""

    @classmethod
    def make_config(cls, args: argparse.Namespace, **given: Any) -> Config:
        """Return the configuration that the options set."""
        return Config(host=args.host or "127.0.0.1", **given)

    def open(self, robot: str, show: Callable[[str], None]) -> None:
        """Prepare to serve a robot, within `serving`; `show` gets each new address for a pilot."""
        show(self.addresses()[0])

    def serving(self, more: Callable[[], list[str]]) -> contextlib.AbstractContextManager[object]:
        """End what `open` began when the `with` block ends; `more` returns lines for the banner."""
        return contextlib.nullcontext()

    def use_tls(self, context: ssl.SSLContext) -> None:
        """Remember the TLS context of the running server, to load renewed `tls_files` into it."""

    @property
    def admits_all(self) -> bool:
        """True if no client has to prove its identity."""
        return True

    @property
    def is_secure(self) -> bool:
        """True if browsers treat the page as a secure context at every address of the page."""
        return True

    def addresses(self) -> list[str]:
        """Return the addresses of the page, the best first."""
        host, scheme = self.config.host, "https" if self.tls_files else "http"
        return [f"{scheme}://{f'[{host}]' if ':' in host else host}:{self.config.port}"]

    def address_for(self, role: Role) -> str:
        """Return the address that gives a browser this role."""
        return self.addresses()[0] + (role.start or "")

    def draw(self, address: str) -> list[str]:
        """Return the lines of an address's QR code; empty if phones cannot reach the address."""
        return []

    def greet(self, more: Sequence[str]) -> str:
        """Return the text for a terminal when the robot is ready; `more` adds lines."""
        return "\n".join([f"Drivelesson is ready: open {self.addresses()[0]}", *more, ""])

    @property
    def names(self) -> Container[str]:
        """The names to which the robot answers; they may change while the server runs."""
        return loopback_names(self.config)

    def advise(self, name: str, address: str) -> str:
        """Return advice after a refused request to `address`, with the unknown host name `name`."""
        return ""

    def explain(self, refusal: Refusal, scope: Scope, headers: dict[str, str]) -> Response:
        """Return the answer to a refused request, with the reason and these `headers`."""
        told = {"error": refusal.reason, "detail": refusal.sentence}
        return JSONResponse(told, refusal.status, headers)

    def see_through(self, scope: Scope) -> Scope | Refusal:
        """Return the request's scope as its client sent it, before any proxy, or a refusal."""
        return scope

    def session_of(self, headers: Mapping[str, str], address: str) -> Session | None:
        """Return the session that a request's headers prove; None if they prove none."""
        found = (credential(headers) for credential in self.credentials)
        return next(filter(None, found), None) or self.find_session(headers, address)

    def find_session(self, headers: Mapping[str, str], address: str) -> Session | None:
        """Return the session of a browser, from its cookie or its address; None if it has none."""
        return Session(Role.PILOT, address, is_crowd=True)

    def session_by_address(self, scope: Scope) -> Session | Refusal | None:
        """Return the session of the key in a request's URL, which players without cookies use.

        Returns:
            None for a URL without a key, and a refusal for a key that is not valid. Streams call
            this repeatedly, because a key can be replaced.
        """
        return None

    def peer(self, scope: Scope) -> tuple[str, int]:
        """Return the address and port of the connection's other end: the client or a proxy."""
        return tuple(scope.get("client") or ("", 0))

    def anonymous(self, address: str) -> Session:
        """Return the session under which a client without a session is counted."""
        return Session(Role.VIEWER, address)

    def check(self, path: str, method: str | None, role: Role) -> Refusal | None:
        """Return the refusal of the first check that refuses a request; None if all pass."""
        refusals = (check(path, method, role) for check in self.checks)
        return next((refusal for refusal in refusals if refusal), None)

    def is_protected(self, person: str) -> bool:
        """True if this session's connections are never closed to make room for others."""
        return person in self.protected or self.has_priority(person)

    # Limits: a server on loopback needs none ----------------------------------------------------

    @property
    def is_full(self) -> bool:
        """True if there is no slot for another websocket."""
        return False

    def limit(self, listener: socket.socket) -> socket.socket:
        """Return the listener from which the server accepts connections."""
        return listener

    def may_ask(self, person: Session) -> bool:
        """Count a request; return False if the session sends too many per second."""
        return True

    def may_log(self, person: str, reason: str) -> bool:
        """False if a refusal of this session for this reason was logged recently."""
        return True

    def note_asked(self, scope: Scope, session: Session | None, *, lasts: bool) -> Refusal | None:
        """Record that a request was read completely; `lasts` is True for a websocket or stream.

        Return a refusal if the session has too many connections.
        """
        return None

    def note_answered(self, scope: Scope) -> None:
        """Record that a request was answered, so that its connection is idle."""

    def take_slot(
        self, scope: Scope, person: Session, end: Callable[[], object], *, is_upload: bool
    ) -> Refusal | None:
        """Count a websocket, stream or upload until `leave`; `end` is called if it is evicted."""
        return None

    def leave(self, scope: Scope) -> None:
        """Free the slot that `take_slot` took, if it took one."""

    def expire(self) -> None:
        """Close connections that have timed out."""

    def close_connections(self) -> None:
        """Close every connection."""


def gateway_type() -> type[Gateway]:
    """Return the gateway of an extension if one is installed, or else `Gateway`."""
    return next((point.load() for point in points(GATEWAY)), Gateway)


def loopback_names(config: Config) -> list[str]:
    """Return the names to which a server answers even without a network."""
    return list(dict.fromkeys(["localhost", "127.0.0.1", "::1", config.host.lower()]))
