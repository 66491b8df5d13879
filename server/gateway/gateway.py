"""Decides which connections and requests reach the application; this gateway serves only loopback.

The extension `access` replaces this gateway by an entry point of `drivelesson.gateway`. The
replacement serves networks and admits browsers that have proved their identity.
"""

from __future__ import annotations

import argparse
import contextlib
import socket
import ssl
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import entry_points
from typing import Any, ClassVar

from starlette.responses import JSONResponse, Response
from starlette.types import Scope

from robot.clock import Clock
from server.config import Config, Limits
from server.gateway.roles import Refusal, Role, Session
from server.gateway.rules import AccessRules

GATEWAY = "drivelesson.gateway"
STOP_PATH = "/api/stop"
"""The emergency stop for a page without a websocket."""
SLOT = "drivelesson.slot"
"""Key in a scope: the limiter's slot of a websocket, stream or upload."""
PREFIX = "drivelesson.prefix"
"""Key in a scope: the path under which the page is served, such as /robot; empty for the root."""
Credential = Callable[[Mapping[str, str]], Session | None]
Check = Callable[[str, str | None, Role], Refusal | None]


class Gateway:
    """Admits every client of this computer as a pilot.

    Attributes:
        credentials: Functions; each returns the session that a request's headers prove, if any.
        checks: Functions; each may refuse a request by path, method (None: a websocket) and role.
        kept: Persons whose connections are never evicted for others.
        has_priority: Returns True for the person who drives, whose connections are not evicted
            either.
    """

    limits_type: ClassVar[type[Limits]] = Limits
    is_tls = False
    """True if the page is served by https. `open` then sets `tls_files`."""
    tls_files: tuple[str, str] | None = None
    """The files of key and chain if the page is served by https."""

    def __init__(self, config: Config, clock: Clock) -> None:
        self.config, self.clock = config, clock
        self.credentials: list[Credential] = []
        self.checks: list[Check] = []
        self.kept: set[str] = set()
        self.has_priority: Callable[[str], bool] = lambda person: False

    @classmethod
    def configure(cls, parser: argparse.ArgumentParser) -> None:
        """Declare options of `drivelesson serve`."""

    @classmethod
    def make_config(cls, args: argparse.Namespace, **given: Any) -> Config:
        """Return the configuration that the options set."""
        return Config(host=args.host or "127.0.0.1", **given)

    def open(self, robot: str, show: Callable[[str], None]) -> None:
        """Prepare to serve a robot; `show` is called with the address for the next pilot."""
        show(self.addresses()[0])

    def serving(self, more: Callable[[], list[str]]) -> contextlib.AbstractContextManager[object]:
        """While the `with` block runs, track the environment; `more` are lines for `greet`."""
        return contextlib.nullcontext()

    def use_tls(self, context: ssl.SSLContext) -> None:
        """Remember the running server's TLS context, whose files may be renewed."""

    @property
    def admits_all(self) -> bool:
        """True if no client has to prove its identity."""
        return True

    @property
    def is_secure(self) -> bool:
        """True if browsers treat the page as a secure context at each of its addresses."""
        return True

    def addresses(self) -> list[str]:
        """Return the addresses of the page, the best first."""
        host, scheme = self.config.host, "https" if self.tls_files else "http"
        return [f"{scheme}://{f'[{host}]' if ':' in host else host}:{self.config.port}"]

    def address_for(self, role: Role) -> str:
        """Return the address that gives a browser this role; an extension may limit its use."""
        return self.addresses()[0] + (role.start or "")

    def draw(self, address: str) -> list[str]:
        """Return an address's QR code as lines; none if phones cannot reach the address."""
        return []

    def greet(self, more: Sequence[str]) -> str:
        """Return the text shown when the robot is ready; `more` are extensions' lines."""
        return "\n".join([f"Drivelesson is ready: open {self.addresses()[0]}", *more, ""])

    def rules(self, public: frozenset[str], open: frozenset[str]) -> AccessRules:
        """Return the access rules, given the extensions' public and open paths."""
        return AccessRules(names=frozenset(loopback_names(self.config)), public=public, open=open)

    def explain(self, refusal: Refusal, scope: Scope, headers: dict[str, str]) -> Response:
        """Return the answer that says why a request is refused; `headers` go into this answer."""
        told = {"error": refusal.reason, "detail": refusal.sentence}
        return JSONResponse(told, refusal.status, headers)

    def see_through(self, scope: Scope) -> Scope | Refusal:
        """Return the request as its client sent it, or why it is refused."""
        return scope

    def session_of(self, headers: Mapping[str, str], address: str) -> Session | None:
        """Return the session of a request; None for a client that has none."""
        for credential in self.credentials:
            if session := credential(headers):
                return session
        return self.find_session(headers, address)

    def find_session(self, headers: Mapping[str, str], address: str) -> Session | None:
        """Return the session of a browser."""
        return Session(Role.PILOT, address, is_crowd=True)

    def session_by_address(self, scope: Scope) -> Session | Refusal | None:
        """Return the session that a request's own address proves, or why it proves none.

        Returns:
            None for an address that names no key. A call while a stream lasts returns a refusal
            once the key is no longer valid.
        """
        return None

    def peer(self, scope: Scope) -> tuple[str, int]:
        """Return the other end of the connection: the client, or its proxy."""
        return tuple(scope.get("client") or ("", 0))

    def anonymous(self, address: str) -> Session:
        """Return the session by which a client without a session is counted."""
        return Session(Role.VIEWER, address)

    def check(self, path: str, method: str | None, role: Role) -> Refusal | None:
        """Return why an extension refuses a request; None if none does."""
        refusals = (check(path, method, role) for check in self.checks)
        return next((refusal for refusal in refusals if refusal), None)

    def is_kept(self, person: str) -> bool:
        """True for persons whose connections are never evicted for others."""
        return person in self.kept or self.has_priority(person)

    # Limits: a server on loopback needs none ----------------------------------------------------

    @property
    def is_full(self) -> bool:
        """True if there is no slot for another websocket."""
        return False

    def limit(self, listener: socket.socket) -> socket.socket:
        """Return the listener from which the server accepts connections."""
        return listener

    def may_ask(self, person: Session) -> bool:
        """Count a request; return False if there were too many."""
        return True

    def may_log(self, person: str, reason: str) -> bool:
        """False if this person's refusal for this reason was logged recently."""
        return True

    def note_asked(self, scope: Scope, session: Session | None, *, lasts: bool) -> Refusal | None:
        """Note a complete request; `lasts` marks a websocket or stream.

        Return a refusal if the client is over a limit.
        """
        return None

    def note_answered(self, scope: Scope) -> None:
        """Note that a request was answered."""

    def take_slot(
        self, scope: Scope, person: Session, end: Callable[[], object], *, is_upload: bool
    ) -> Refusal | None:
        """Count a websocket, stream or upload until `leave`; `end` is called when it is evicted."""
        return None

    def leave(self, scope: Scope) -> None:
        """Free the slot that `take_slot` took, if it took one."""

    def expire(self) -> None:
        """Close connections that have timed out."""

    def close_connections(self) -> None:
        """Close every connection."""


def gateway_type() -> type[Gateway]:
    """Return the installed gateway: an extension's for networks, or else this one."""
    found = [point.load() for point in entry_points(group=GATEWAY)]
    return found[0] if found else Gateway


def loopback_names(config: Config) -> list[str]:
    """Return the names to which every server answers."""
    return list(dict.fromkeys(["localhost", "127.0.0.1", "::1", config.host.lower()]))
