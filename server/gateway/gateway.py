"""Which connections and requests reach the application: the one of a server on loopback.

The extension `access` puts its own in this place, by the entry point of `drivelesson.gateway`: that
one serves networks and admits browsers that have proved who they are.
"""

from __future__ import annotations

import argparse
import contextlib
import socket
import ssl
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import entry_points
from typing import Any, ClassVar

from starlette.datastructures import Headers
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
"""In a scope: what a limiter counts of a websocket, stream or upload."""
PREFIX = "drivelesson.prefix"
"""In a scope: the path under which the page is served, such as /robot; or nothing."""
Credential = Callable[[Mapping[str, str]], Session | None]
Check = Callable[[str, str | None, Role], Refusal | None]


class Gateway:
    """Admits every client of this computer as a pilot.

    Attributes:
        credentials: Each returns the session that a request's headers prove, if any.
        checks: Each may refuse a request, by path, method (None: a websocket) and role.
        kept: Persons whose connections are never evicted for others.
        has_priority: True for further such persons: the one who drives.
    """

    limits_type: ClassVar[type[Limits]] = Limits
    watch_by: str = ""
    """Sentence that tells a player without a session how it can watch."""
    tls_files: tuple[str, str] | None = None
    """The files of key and chain where the page is served by https."""

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
        """Return the configuration that the options ask for."""
        return Config(host=args.host or "127.0.0.1", **given)

    def open(self, robot: str, show: Callable[[str], None]) -> None:
        """Prepare to serve a robot; `show` is given the address by which the next pilot comes."""
        show(self.addresses()[0])

    def serving(self, more: Callable[[], list[str]]) -> contextlib.AbstractContextManager[object]:
        """Follow what changes around the server inside the block; `more` are lines for `greet`."""
        return contextlib.nullcontext()

    def use_tls(self, context: ssl.SSLContext) -> None:
        """Take the context of the running server, whose files may be renewed."""

    @property
    def admits_all(self) -> bool:
        """True if no client has to prove its identity."""
        return True

    @property
    def is_secure(self) -> bool:
        """True if browsers give every way to the page a secure context."""
        return True

    def addresses(self) -> list[str]:
        """Return the addresses of the page, the best first."""
        host, scheme = self.config.host, "https" if self.tls_files else "http"
        return [f"{scheme}://{f'[{host}]' if ':' in host else host}:{self.config.port}"]

    def address_for(self, role: Role) -> str:
        """Return where a browser gets this role: once, if it has to prove who it is."""
        return self.addresses()[0] + (role.start or "")

    def draw(self, address: str) -> list[str]:
        """Return an address as lines that a phone can scan, if it can be reached by one."""
        return []

    def greet(self, more: Sequence[str]) -> str:
        """Return what a person is shown when the robot is ready; `more` are extensions' lines."""
        return "\n".join([f"Drivelesson is ready: open {self.addresses()[0]}", *more, ""])

    def rules(self, public: frozenset[str], open: frozenset[str]) -> AccessRules:
        """Return the access rules, given the extensions' public and open paths."""
        return AccessRules(names=frozenset(loopback_names(self.config)), public=public, open=open)

    def explain(self, refusal: Refusal, asked: Headers, headers: dict[str, str]) -> Response:
        """Return the answer that says why a request is refused; `headers` are its own."""
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
        """Return the session that a request's own address proves, or why it does not.

        Returns:
            None for an address that names no key. Called again while a stream lasts, it returns a
            refusal once the key is no longer valid.
        """
        return None

    def unread(self, scope: Scope) -> int:
        """Return how many bytes the client has been sent and not read yet, as far as known."""
        return 0

    def anonymous(self, address: str) -> Session:
        """Return what a client without a session is counted by."""
        return Session(Role.VIEWER, address)

    def check(self, path: str, method: str | None, role: Role) -> Refusal | None:
        """Return why an extension refuses a request; None if none does."""
        refusals = (check(path, method, role) for check in self.checks)
        return next((refusal for refusal in refusals if refusal), None)

    def is_kept(self, person: str) -> bool:
        """True for persons whose connections are never evicted for others."""
        return person in self.kept or self.has_priority(person)

    # Limits, which a server on loopback needs none of -------------------------------------------

    @property
    def is_full(self) -> bool:
        """True if no websocket finds a place."""
        return False

    def limit(self, listener: socket.socket) -> socket.socket:
        """Return the listener by which the server accepts connections."""
        return listener

    def may_ask(self, person: Session) -> bool:
        """Count a request; False if there were too many."""
        return True

    def may_log(self, person: str, reason: str) -> bool:
        """False if the log has said lately for which reason this person is refused."""
        return True

    def note_asked(self, scope: Scope, session: Session | None, *, lasts: bool) -> Refusal | None:
        """Note a complete request; a websocket or stream lasts. Return why it is one too many."""
        return None

    def note_answered(self, scope: Scope) -> None:
        """Note that a request has its answer."""

    def take_slot(
        self, scope: Scope, person: Session, end: Callable[[], object], *, is_upload: bool
    ) -> Refusal | None:
        """Count a websocket, stream or upload, until `leave`; `end` ends it for somebody else."""
        return None

    def leave(self, scope: Scope) -> None:
        """Give back what `take_slot` took, if it did."""

    def expire(self) -> None:
        """Close connections that have timed out."""

    def close_connections(self) -> None:
        """Close every connection."""


def gateway_type() -> type[Gateway]:
    """Return the installed gateway: the one for networks if there is an extension for them."""
    found = [point.load() for point in entry_points(group=GATEWAY)]
    return found[0] if found else Gateway


def loopback_names(config: Config) -> list[str]:
    """Return the names to which every server answers."""
    return list(dict.fromkeys(["localhost", "127.0.0.1", "::1", config.host.lower()]))
