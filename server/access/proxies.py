"""Restores a request that came through a proxy to the form in which its client sent it.

The option `--behind-proxy` lists the addresses that people open. The proxy's headers say which of
these addresses the client opened, and who the client is. Headers that no trusted proxy sent are
ignored.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple
from urllib.parse import quote

from starlette.datastructures import Headers
from starlette.types import Scope

from server.access.config import Network, PublicAddress
from server.config import as_address
from server.gateway.gateway import PREFIX
from server.gateway.roles import Refusal
from server.gateway.rules import host_name

PEER = "drivelesson.peer"
"""Key in the scope of a request that a proxy forwarded: the proxy's address and port."""
SPOKEN = ("forwarded", "x-forwarded-for", "x-forwarded-host", "x-forwarded-proto")
_PAIR = re.compile(r'(?<![\w-])([\w-]+)\s*=\s*("(?:[^"\\]|\\.)*"|[^;,"\s]*)|(,)')


class _Hop(NamedTuple):
    """What one proxy reports: client, host and scheme; fields without a report are empty."""

    client: str = ""
    host: str = ""
    scheme: str = ""


class Proxies:
    """The proxies in front of a server.

    Args:
        public: The addresses that people open.
        trusted: The networks of trusted proxies.
        admits_all: True if the server needs no pairing. A server without pairing refuses requests
            that an unknown proxy forwarded, because anybody may have sent them.
    """

    def __init__(
        self, public: Sequence[PublicAddress], trusted: Iterable[Network], *, admits_all: bool
    ) -> None:
        self._public, self._trusted, self._admits_all = public, tuple(trusted), admits_all

    def see_through(self, scope: Scope) -> Scope | Refusal:
        """Return the scope of the client's request to the proxy, or a response that refuses it."""
        said = _said(scope)
        if not self._public:
            if not said or not self._admits_all:
                return scope
            sentence = (
                f"{next(iter(said)).title()} shows that an unknown proxy forwarded this request. "
                "Without pairing, anybody could drive through that proxy: start the robot "
                "with --behind-proxy and the address that people open."
            )
            return Refusal(403, "proxy", sentence)
        peer = tuple(scope.get("client") or ("", 0))
        if not self.is_proxy(str(peer[0])):
            return scope
        told = [self._walk(str(peer[0]), hops) for hops in _hops(said)]
        if len(told) > 1 and told[0] != told[1]:
            sentence = "Forwarded and X-Forwarded-* disagree: have the proxy remove one of the two."
            return Refusal(400, "proxy", sentence)
        hop = told[0] if told else _Hop(client=str(peer[0]))
        public = self._choose(hop, scope)
        if public is None:
            asked = f"The proxy was asked for {hop.host[:80]!r}"
            what = "add that address to --behind-proxy, or have the proxy refuse that name."
            return Refusal(421, "host", f"{asked}: {what}")
        return _as_sent(scope, public, hop.client, peer)

    def is_proxy(self, address: str) -> bool:
        """True if a trusted proxy has this address."""
        own = as_address(address)
        return own is not None and any(own in network for network in self._trusted)

    def _walk(self, peer: str, hops: list[_Hop]) -> _Hop:
        """Follow the reports from proxy to proxy, as long as the proxies are trusted.

        The first untrusted address is the client's. A client's own reports may be forged.
        """
        told = _Hop(client=peer)
        for hop in reversed(hops):
            if not self.is_proxy(told.client):
                break
            names_client = as_address(hop.client) is not None
            client = hop.client if names_client else told.client
            told = _Hop(client, hop.host or told.host, hop.scheme or told.scheme)
            if not names_client:
                break
        return told

    def _choose(self, hop: _Hop, scope: Scope) -> PublicAddress | None:
        """Return the address that the client opened; None if the proxy reports an unknown one."""
        asked = hop.host or Headers(scope=scope).get("host", "")

        def fit(public: PublicAddress) -> tuple[bool, bool, bool]:
            same = public.name == host_name(asked), public.host == asked.lower()
            return (*same, public.scheme == hop.scheme.lower())

        best = max(self._public, key=fit)
        return None if hop.host and best.name != host_name(asked) else best


def _said(scope: Scope) -> dict[str, str]:
    """Return the headers that proxies set; lines with the same name are joined by commas."""
    said: dict[str, str] = {}
    for raw_name, raw_value in scope["headers"]:
        name, value = raw_name.decode("latin-1").lower(), raw_value.decode("latin-1")
        if name in SPOKEN:
            said[name] = f"{said[name]}, {value}" if name in said else value
    return said


def _hops(said: dict[str, str]) -> list[list[_Hop]]:
    """Return the proxies' reports for each kind of header, with the nearest proxy last.

    The kinds are `Forwarded` and `X-Forwarded-*`.
    """
    kinds = []
    if "forwarded" in said:
        elements: list[dict[str, str]] = [{}]
        # Ignore a header with an unclosed quote, in which a client could hide what the proxy
        # appended.
        is_whole = not _PAIR.sub("", said["forwarded"]).strip("; \t")
        for name, value, comma in _PAIR.findall(said["forwarded"]) if is_whole else ():
            if comma:
                elements.append({})
            else:
                elements[-1][name.lower()] = re.sub(r"\\(.)", r"\1", value.strip('"'))
        names = ("for", "host", "proto")
        kinds.append([_hop(*(each.get(name, "") for name in names)) for each in elements])
    if any(name in said for name in SPOKEN[1:]):
        clients, hosts, schemes = (
            [one.strip() for one in said.get(name, "").split(",")] for name in SPOKEN[1:]
        )
        # A proxy may replace the list of hosts or schemes instead of adding to it. The list is then
        # shorter than the list of clients.
        kinds.append(
            [
                _hop(client, hosts[max(-n, -len(hosts))], schemes[max(-n, -len(schemes))])
                for n, client in zip(range(len(clients), 0, -1), clients, strict=True)
            ]
        )
    return kinds


def _hop(client: str, host: str, scheme: str) -> _Hop:
    without_port = re.match(r"\[(.+)\]|(\d+\.[\d.]+):", client)
    return _Hop(without_port[1] or without_port[2] if without_port else client, host, scheme)


def _as_sent(scope: Scope, public: PublicAddress, client: str, peer: Any) -> Scope:
    """Return a copy of a scope with the host, scheme, client and path that the client used."""
    kept = [(name, value) for name, value in scope["headers"] if name.lower() != b"host"]
    path, is_socket = str(scope["path"]), scope["type"] == "websocket"
    if path.startswith(f"{public.prefix}/"):  # some proxies remove the prefix, others keep it
        path = path[len(public.prefix) :]
    return {
        **scope,
        "scheme": public.scheme.replace("http", "ws") if is_socket else public.scheme,
        "headers": [(b"host", public.host.encode("ascii")), *kept],
        "client": (client, 0),
        "path": path,
        "raw_path": quote(path).encode("ascii"),
        PEER: peer,
        PREFIX: public.prefix,
    }
