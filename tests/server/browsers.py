"""Counts the pages that stay dead if many paired browsers behind one address load the page at once.

Each browser has six connections, like a real one, and requests what a first visit needs: the
document, its files, its service worker, both websockets and a first picture.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
import ssl
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.access.certificates import Certificates
from server.access.config import NetworkConfig, PublicAddress, read_networks
from server.access.pairing import Paired, Pairing, cookie_name
from tests.e2e.nginx import plain_site, running_nginx, site_of_the_docs
from tests.joined_page import joined_page
from tests.kit.ports import free_port

from .live_robot import live_server

LINES = httpx.Limits(max_connections=6)
WITHIN_S = 1.0
_NAMED = re.compile(r"""["'](/?(?:js|css|icons)/[\w./-]+\.(?:js|css|svg|png))["']""")
PATIENCE_S = 120.0


@dataclass
class Browser:
    """One of the browsers."""

    address: str
    cookie: str
    trust: ssl.SSLContext | None = None

    async def visit(self) -> None:
        """Load the page, and everything that it needs until it shows a picture.

        Raises:
            Exception: The error of whatever fails first.
        """
        options: dict[str, Any] = {"base_url": self.address, "headers": {"Cookie": self.cookie}}
        options |= {"verify": self.trust or False, "limits": LINES, "timeout": PATIENCE_S}
        async with httpx.AsyncClient(**options) as client:
            html = await self._get(client, "")
            done, wanted = {""}, {*self._named(html), "sw.js", "manifest.webmanifest"}
            sockets = asyncio.create_task(self._see())
            while wanted:
                got = await asyncio.gather(*(self._get(client, path) for path in sorted(wanted)))
                done |= wanted
                wanted = {name for text in got for name in self._named(text)} - done
            await sockets

    def _named(self, text: str) -> list[str]:
        found = _NAMED.findall(text)
        return [name.lstrip("/") for name in found if name.count("-") or "icons" not in name]

    async def _get(self, client: httpx.AsyncClient, path: str) -> str:
        is_new = False

        async def note(event: str, _: object) -> None:
            nonlocal is_new
            is_new |= event.startswith("connection.connect_tcp")

        try:
            answer = await client.get(path, extensions={"trace": note})
        except httpx.TransportError:
            if is_new:
                raise
            # A server may close an idle connection at that moment; browsers then repeat the
            # request on a new one.
            answer = await client.get(path)
        assert answer.status_code == 200, (path, answer.status_code)
        return answer.text

    async def _see(self) -> None:
        from websockets.asyncio.client import connect

        url = self.address.replace("http", "ws", 1)
        options: dict[str, Any] = {"compression": None, "open_timeout": PATIENCE_S}
        options |= {"additional_headers": {"Cookie": self.cookie}, "ssl": self.trust}
        async with (
            connect(url + "ws/drive", **options) as drive,
            connect(url + "ws/video", **options) as video,
        ):
            assert '"hello"' in str(await drive.recv())
            assert isinstance(await video.recv(), bytes)


async def dead_pages(browsers: list[Browser]) -> list[str]:
    """Have all browsers connect within a second; return the errors of the dead pages."""

    async def come(number: int, browser: Browser) -> None:
        await asyncio.sleep(WITHIN_S * number / len(browsers))
        await browser.visit()

    visits = (come(number, browser) for number, browser in enumerate(browsers))
    ended = await asyncio.wait_for(asyncio.gather(*visits, return_exceptions=True), PATIENCE_S)
    return [repr(one)[:300] for one in ended if one is not None]


WAYS = ("http", "TLS", "http through nginx", "TLS through nginx")


def check_no_page_is_dead(
    tmp_path: Path, certificates: Certificates | None, count: int, ways: Sequence[str] = WAYS
) -> None:
    """Load many pages at once: over http and TLS, without nginx and through it."""
    pytest.importorskip("websockets.asyncio.client", reason="Debian 12's websockets has it not")
    for way in ways:
        folder = tmp_path / way.replace(" ", "-")
        folder.mkdir()
        with _serving(way, folder, certificates) as browser:
            dead = asyncio.run(dead_pages([browser() for _ in range(count)]))
        assert dead == [], (way, len(dead), dead[:3])


@contextlib.contextmanager
def _serving(
    way: str, folder: Path, certificates: Certificates | None
) -> Iterator[Callable[[], Browser]]:
    """While the `with` block runs, serve; yield a function that returns a paired browser."""
    is_tls, is_behind_nginx, port = "TLS" in way, "nginx" in way, free_port()
    pairing = Pairing(10)
    invitation, _ = pairing.invite(0.0)
    options: dict[str, Any] = {"lan": True, "host": "127.0.0.1", "tls": is_tls}
    if is_behind_nginx:
        address = f"https://localhost:{port}/rover" if is_tls else f"http://localhost:{port}"
        public = (PublicAddress.parse(address),)
        options = {"public": public, "proxies": read_networks("127.0.0.1")}
    config = NetworkConfig(port=0, web=joined_page(), data=folder, **options)
    own = certificates if is_tls and not is_behind_nginx else None
    trust = ssl.create_default_context()
    trust.check_hostname, trust.verify_mode = False, ssl.CERT_NONE
    with contextlib.ExitStack() as stack:
        server = stack.enter_context(live_server(config, pairing=pairing, certificates=own))
        if is_behind_nginx:
            site = (
                site_of_the_docs(port, [server.port], folder, tls=True)
                if is_tls
                # The uvicorn of Debian 12 refuses requests with an `Upgrade` header that are not an
                # upgrade.
                else plain_site(port, server.port, connection="$http_connection")
            )
            stack.enter_context(running_nginx(folder / "nginx", site, port))
        else:
            address = server.address

        def paired() -> Browser:
            one = pairing.redeem(invitation, 0.0)
            assert isinstance(one, Paired)
            cookie = f"{cookie_name(config)}={one.secret}"
            return Browser(f"{address}/", cookie, trust if is_tls else None)

        yield paired
