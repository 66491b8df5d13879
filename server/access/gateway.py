"""The gateway of a server on a network: pairing, sessions, proxies, limits and certificates."""

from __future__ import annotations

import argparse
import contextlib
import datetime as dt
import logging
import re
import socket
import ssl
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar
from urllib.parse import parse_qs

from starlette.datastructures import Headers
from starlette.requests import cookie_parser
from starlette.responses import HTMLResponse, Response
from starlette.types import Scope

from robot.clock import Clock
from robot.errors import ConfigurationError
from server.access.admission import AdmissionControl, Peer, address_key
from server.access.announcement import Announcement
from server.access.banner import greet_next, greet_phones, pairing_address
from server.access.config import (
    DEFAULT_HOSTNAME,
    NetworkConfig,
    NetworkLimits,
    PublicAddress,
    read_networks,
)
from server.access.listener import TOO_MANY_CONNECTIONS, AdmissionListener, connection_capacity
from server.access.pairing import Pairing, cookie_name
from server.access.player_key import PlayerKey
from server.access.proxies import PEER, Proxies
from server.access.surroundings import Place, Surroundings, Watch
from server.access.terminal_code import draw_qr
from server.access.unknown_name import explain_unknown_name
from server.config import Config
from server.gateway.gateway import READING, SLOT, Gateway
from server.gateway.guard import VIDEO
from server.gateway.roles import Refusal, Role, Session
from server.gateway.rules import host_name as opened_name

if TYPE_CHECKING:
    from server.access.certificates import RenewedCertificates

log = logging.getLogger(__name__)
_NAME_S = 1.5
"""How long the server's start waits for a name on the network, in seconds."""
_BAD_KEY = Refusal(401, "key", "The key in this address is not valid. Maybe it was replaced.")
_LABEL = re.compile(r"[a-z0-9]([a-z0-9-]{0,61}[a-z0-9])?", re.IGNORECASE)
_WATCH_BY = (
    "For a video player, or an <img> on another site, run `drivelesson player-key` on the robot's "
    "computer and use the address that it prints."
)
_COOKIES = re.compile(rb"\r\ncookie:([^\r]*)\r\n", re.I)


class NetworkGateway(Gateway):
    """Admits only paired browsers if other machines can reach the server, and limits each client.

    Args:
        pairing: The sessions of browsers; if None, `open` reads them if pairing is needed.
        surroundings: The server's addresses and names; if None, they follow from `config`.
    """

    limits_type: ClassVar[type[NetworkLimits]] = NetworkLimits
    config: NetworkConfig
    not_admitted = Refusal(
        401,
        "unpaired",
        "This browser is not paired. Open the address that the robot's terminal shows.",
        "/pair",
    )

    def __init__(
        self,
        config: Config,
        clock: Clock,
        pairing: Pairing | None = None,
        surroundings: Surroundings | None = None,
    ) -> None:
        super().__init__(NetworkConfig.of(config), clock)
        config = self.config
        self.is_tls, self.allows_addresses = config.tls, config.needs_pairing
        self.origins = tuple(public.origin for public in config.public)
        self.admission = AdmissionControl(
            config.limits, connection_capacity(), self.is_protected, self._recognise
        )
        self._cookie = cookie_name(config)
        self._player_key = PlayerKey(config.data)
        self.surroundings = surroundings or Surroundings(config)
        self._announcement: Announcement | None = None
        self._watch: Watch | None = None
        self._renewed: RenewedCertificates | None = None
        self._show: Callable[[str], None] = lambda address: None
        self._more: Callable[[], list[str]] = list
        self.pairing: Pairing | None = None
        if pairing is not None:
            self._use(pairing)

    def _use(self, pairing: Pairing) -> None:
        sockets, self.pairing = self.admission.sockets, pairing
        pairing.is_in_use = lambda name: sockets.has(name) or self.has_priority(name)

    @classmethod
    def configure(cls, parser: argparse.ArgumentParser) -> None:
        add, shown = parser.add_argument_group("network").add_argument, " (default: %(default)s)"
        add("--lan", action="store_true", help="serve the local network, for paired browsers only")
        text = "address at which a proxy serves the page, such as https://home.example/robot/; "
        text += "separate several with commas; admit only paired browsers"
        add("--behind-proxy", default="", metavar="URL", help=text)
        text = "the proxy's addresses or networks, separated by commas (default: this machine)"
        add("--proxy-at", default="127.0.0.0/8,::1", metavar="ADDRESS", help=text)
        add(
            "--tls",
            action="store_true",
            help="serve https, with a certificate that Drivelesson makes",
        )
        text = f"with --lan: the name of this machine in its network, without .local{shown}"
        add("--hostname", type=_read_label, default=DEFAULT_HOSTNAME, help=text)
        text = "another name of this machine in its network, such as rover.fritz.box; may "
        text += "be repeated, or list several with commas"
        add("--also-at", action="append", default=[], metavar="NAME", help=text)

    @classmethod
    def make_config(cls, args: argparse.Namespace, **given: Any) -> NetworkConfig:
        return NetworkConfig(
            host=args.host or ("::" if args.lan else "127.0.0.1"),
            lan=args.lan,
            tls=args.tls,
            public=tuple(map(PublicAddress.parse, filter(None, args.behind_proxy.split(",")))),
            proxies=read_networks(args.proxy_at),
            hostname=args.hostname,
            also_at=tuple(
                name.strip().lower().rstrip(".")
                for names in args.also_at
                for name in names.split(",")
                if name.strip()
            ),
            **given,
        )

    def open(self, robot: str, show: Callable[[str], None]) -> None:
        config, self._show = self.config, show
        if config.lan:
            self._announcement = Announcement(config, robot)
            announcement = self._announcement
            self.surroundings = Surroundings(
                config, claim=announcement.announce, is_taken=announcement.must_yield
            )
            self._watch = Watch(self.surroundings, self.clock)
            self._watch.start()
        if config.tls:
            from server.access.certificates import RenewedCertificates

            now = dt.datetime.now(dt.UTC)
            renewed = RenewedCertificates(config.data / "tls", self.surroundings.certified, now)
            self.tls_files = str(renewed.files.key), str(renewed.files.chain)
            self._renewed = renewed
        if config.needs_pairing:
            failures = getattr(config.limits, "pairing_failures", 10)
            self._use(Pairing(failures, config.data / "paired.json", self._tell_soon))
        if self._watch is not None:
            self._watch.wait_for_the_first(_NAME_S)
        self._follow_changes()
        show(self.address_for(Role.PILOT))

    def _tell_soon(self, role: Role, token: str) -> None:
        """Print on a thread: a terminal that is paused (Ctrl+S) must not delay a STOP."""
        self.clock.start_thread(lambda: self._tell(role, token), "next code")

    def _tell(self, role: Role, token: str) -> None:
        """Print how to pair the next browser, because the last one has used up the token."""
        address = self.addresses()[0]
        print(greet_next(address, role, token), flush=True)
        if role is Role.PILOT:
            self._show(pairing_address(address, token))

    def _follow_changes(self) -> None:
        self.surroundings.listeners.append(self._follow)
        if self._renewed is not None:
            self.surroundings.ticks.append(self._renew)

    @contextlib.contextmanager
    def serving(self, more: Callable[[], list[str]]) -> Iterator[None]:
        self._more = more
        try:
            yield
        finally:  # end the announcement even if the server never started
            if self._watch is not None:
                self._watch.stop()
            if self._announcement is not None:
                self._announcement.close()

    def use_tls(self, context: ssl.SSLContext) -> None:
        if self._renewed is not None:
            self._renewed.use(context)

    def _follow(self, before: Place, now: Place) -> None:
        """Print the new addresses and pairing codes.

        Phones have to pair again, because a browser does not send the cookie of the old address to
        the new one.
        """
        if (before.addresses, before.hostname) == (now.addresses, now.hostname):
            return
        log.warning("the robot is now at %s", " ".join(self.addresses()))
        if now.hostname != before.hostname:
            print(f"Another robot is {before.hostname}.local, so this one is {now.hostname}.local.")
        if self.pairing is not None:
            print(f"The network has changed.\n{self.greet(self._more())}", flush=True)
            self._show(self.address_for(Role.PILOT))

    def _renew(self, _: Place) -> None:
        """Renew the certificate if the clock was set, or if the robot's names have changed."""
        assert self._renewed is not None
        try:
            now = dt.datetime.fromtimestamp(self.clock.wall_s(), dt.UTC)
            why = self._renewed.renew(self.surroundings.certified, now)
        except (ConfigurationError, OSError, OverflowError) as error:
            log.warning("cannot renew the certificate: %s", error)
            return
        if why is not None:
            log.info("certificate renewed: %s", why)

    @property
    def admits_all(self) -> bool:
        return self.pairing is None

    @property
    def is_secure(self) -> bool:
        return self.config.is_secure or not self.config.needs_pairing

    def addresses(self) -> list[str]:
        return self.surroundings.page_addresses

    def address_for(self, role: Role) -> str:
        if self.pairing is None:
            return super().address_for(role)
        return pairing_address(self.addresses()[0], self.pairing.tokens[role])

    def draw(self, address: str) -> list[str]:
        return draw_qr(address).splitlines()

    def greet(self, more: Sequence[str]) -> str:
        if self.pairing is None:
            return super().greet(more)
        return greet_phones(self.addresses(), self.pairing.tokens, more)

    @property
    def names(self) -> Container[str]:
        return self.surroundings

    def advise(self, name: str, address: str) -> str:
        """Return advice for a refused client: the robot may have another name, or a proxy may have
        forwarded the request."""
        known = f" If {name} is its name, start it with --also-at {name}." if name else ""
        proxy = f"start the robot with --behind-proxy {address}"
        return f"{known} If a proxy forwarded this request, {proxy}"

    @property
    def _proxies(self) -> Proxies:
        config = self.config
        return Proxies(config.public, config.proxies, admits_all=self.admits_all)

    def explain(self, refusal: Refusal, scope: Scope, headers: dict[str, str]) -> Response:
        """Return the answer to a refused request.

        A browser that opened an unknown name gets a page with the right addresses. A video player
        is told how to get an address with a key.
        """
        asked = Headers(scope=scope)
        if scope["path"] == VIDEO and refusal.status in (401, 403):
            refusal = replace(refusal, sentence=f"{refusal.sentence} {_WATCH_BY}")
        if refusal.reason != "host" or "text/html" not in asked.get("accept", ""):
            return super().explain(refusal, scope, headers)
        name = opened_name(asked.get("host", ""))[:80]
        page = explain_unknown_name(name, refusal.open_at, asked.get("accept-language", ""))
        headers["content-security-policy"] = "default-src 'none'"
        return HTMLResponse(page, refusal.status, headers)

    def see_through(self, scope: Scope) -> Scope | Refusal:
        return self._proxies.see_through(scope)

    def find_session(self, headers: Mapping[str, str], address: str) -> Session | None:
        if self.pairing is None:
            return super().find_session(headers, address_key(address))
        return self.pairing.find(cookie_parser(headers.get("cookie", "")).get(self._cookie, ""))

    def session_by_address(self, scope: Scope) -> Session | Refusal | None:
        if scope["path"] != VIDEO or scope.get("method") not in READING:
            return None
        query = parse_qs(scope["query_string"].decode("latin-1"), keep_blank_values=True)
        if not (given := query.get("key")):
            return None
        address = address_key((scope.get("client") or ("", 0))[0])
        is_valid = self._player_key.accepts(given[0])
        return Session(Role.VIEWER, f"player {address}", is_crowd=True) if is_valid else _BAD_KEY

    def _recognise(self, head: bytes, address: str) -> Session | None:
        """Return the session whose cookie is in a request's first bytes; None if there is none."""
        found = _COOKIES.search(head)
        is_proxy = self.config.public and self._proxies.is_proxy(address)
        if self.pairing is None or found is None or is_proxy:
            return None
        return self.pairing.find(cookie_parser(found[1].decode("latin-1")).get(self._cookie, ""))

    def peer(self, scope: Scope) -> Peer:
        return scope.get(PEER) or super().peer(scope)

    def anonymous(self, address: str) -> Session:
        return Session(Role.VIEWER, address_key(address))

    def is_protected(self, person: str) -> bool:
        is_owner = self.pairing is not None and self.pairing.is_owner(person)
        return is_owner or super().is_protected(person)

    @property
    def is_full(self) -> bool:
        return self.admission.sockets.is_full

    def limit(self, listener: socket.socket) -> socket.socket:
        return AdmissionListener(self.admission, self.clock, listener)

    def may_ask(self, person: Session) -> bool:
        return self.admission.may_ask(person, self.clock.now_s())

    def note_asked(self, scope: Scope, session: Session | None, *, lasts: bool) -> Refusal | None:
        peer, line = self.peer(scope), session
        if PEER in scope:  # the connection of a proxy may carry the requests of many people
            line = Session(Role.VIEWER, f"proxy {peer[0]}", is_crowd=True)
        if self.admission.asked(peer, line, self.clock.now_s(), lasts=lasts):
            return None
        return Refusal(429, "connections", TOO_MANY_CONNECTIONS)

    def note_answered(self, scope: Scope) -> None:
        self.admission.answered(self.peer(scope), self.clock.now_s())

    def take_slot(
        self, scope: Scope, person: Session, end: Callable[[], object], *, is_upload: bool
    ) -> Refusal | None:
        limiter = self.admission.uploads if is_upload else self.admission.sockets
        slot = limiter.take(person, self.clock.now_s(), end)
        if slot is None:
            return Refusal(
                503, "clients", "Too many pages are open, or too many models are being transferred."
            )
        scope[SLOT] = slot
        return None

    def leave(self, scope: Scope) -> None:
        if (slot := scope.get(SLOT)) is not None:
            self.admission.sockets.give_back(slot)
            self.admission.uploads.give_back(slot)

    def expire(self) -> None:
        self.admission.expire(self.clock.now_s())

    def close_connections(self) -> None:
        for slot in list(self.admission.connections.values()):
            slot.close()


def _read_label(text: str) -> str:
    """Check a host name given as an option; it must be one label, without a dot."""
    if not _LABEL.fullmatch(text):
        raise argparse.ArgumentTypeError(
            f"must be at most 63 letters, digits and hyphens, without a dot, not {text!r}"
        )
    return text
