"""Every page loads, even if many paired browsers behind one address load it at once.

Each browser has six connections, like a real one, and requests what a first visit needs: the
document, its files, its service worker, both websockets and a first picture.
"""

import asyncio
import contextlib
import datetime as dt
import json
import ssl
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.access import gateway
from server.access.certificates import make_certificates
from server.access.config import NetworkConfig, PublicAddress, read_networks
from server.access.listener import connection_capacity
from server.access.pairing import Pairing, cookie_name
from tests.e2e.nginx import plain_site, running_nginx, site_of_the_docs
from tests.joined_page import joined_page
from tests.kit.ports import free_port
from tests.kit.sizes import IS_FULL, size
from tests.server.live_robot import live_server

LINES = httpx.Limits(max_connections=6)
WITHIN_S = 1.0
PATIENCE_S = 120.0
WAYS = (
    ("http", "TLS", "http through nginx", "TLS through nginx")
    if IS_FULL
    else ("TLS through nginx",)
)


@pytest.mark.realtime
def test_no_page_is_dead_however_many_browsers_come_at_once(tmp_path, monkeypatch):
    pytest.importorskip("websockets.asyncio.client", reason="Debian 12's websockets lacks it")
    with monkeypatch.context() as patch:
        # Windows allows 384; a class of 30 opens 240 at once, so half of the pages lacked a file.
        patch.setattr(gateway, "connection_capacity", lambda: 100)
        check_no_page_is_dead("http", tmp_path / "few", 8)
    # With a reserve, a page needs twelve connections, so Windows allows 32 pages.
    count = min(size("BROWSERS", 6, 60), connection_capacity() // 12)
    for way in WAYS:
        check_no_page_is_dead(way, tmp_path / way.replace(" ", "-"), count)


def check_no_page_is_dead(way: str, folder: Path, count: int) -> None:
    """Load the page with this number of browsers within a second."""

    async def come(number: int, browser: Browser) -> None:
        await asyncio.sleep(WITHIN_S * number / count)
        await browser.visit()

    async def visits() -> list[BaseException | None]:
        coming = (come(number, browser()) for number in range(count))
        return await asyncio.wait_for(asyncio.gather(*coming, return_exceptions=True), PATIENCE_S)

    with _serving(way, folder) as browser:
        dead = [repr(one)[:300] for one in asyncio.run(visits()) if one is not None]
    assert dead == [], (way, len(dead), dead[:3])


@dataclass
class Browser:
    """A browser that loads the page."""

    address: str
    cookie: str
    trust: ssl.SSLContext | None = None

    async def visit(self) -> None:
        """Load the page, and everything that it needs until it shows a picture.

        Raises:
            Exception: The first error.
        """
        files = json.loads((joined_page() / "shell.json").read_text("utf-8"))
        options: dict[str, Any] = {"base_url": self.address, "headers": {"Cookie": self.cookie}}
        options |= {"verify": self.trust or False, "limits": LINES, "timeout": PATIENCE_S}
        async with httpx.AsyncClient(**options) as client:
            await self._get(client, "")
            sockets = self._see()
            await asyncio.gather(sockets, *(self._get(client, one) for one in (*files, "sw.js")))

    async def _get(self, client: httpx.AsyncClient, path: str) -> None:
        is_new = False

        async def note(event: str, _: object) -> None:
            nonlocal is_new
            is_new |= event.startswith("connection.connect_tcp")

        try:
            answer = await client.get(path, extensions={"trace": note})
        except httpx.TransportError:
            if is_new:
                raise
            # Browsers repeat a request if the server has just closed the idle connection.
            answer = await client.get(path)
        assert answer.status_code == 200, (path, answer.status_code)

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


@contextlib.contextmanager
def _serving(way: str, folder: Path) -> Iterator[Callable[[], Browser]]:
    """Serve inside the `with` block; yield a function that returns a paired browser."""
    folder.mkdir()
    is_tls, is_behind_nginx, port = "TLS" in way, "nginx" in way, free_port()
    pairing, certificates = Pairing(10), None
    invitation, _ = pairing.invite(0.0)
    options: dict[str, Any] = {"lan": True, "host": "127.0.0.1", "tls": is_tls}
    if is_behind_nginx:
        address = f"https://localhost:{port}/rover" if is_tls else f"http://localhost:{port}"
        public = (PublicAddress.parse(address),)
        options = {"public": public, "proxies": read_networks("127.0.0.1")}
    elif is_tls:
        certificates = make_certificates(folder / "tls", ["127.0.0.1"], dt.datetime.now(dt.UTC))
    config = NetworkConfig(port=0, web=joined_page(), data=folder, **options)
    trust = ssl.create_default_context()
    trust.check_hostname, trust.verify_mode = False, ssl.CERT_NONE
    with contextlib.ExitStack() as stack:
        server = stack.enter_context(
            live_server(config, pairing=pairing, certificates=certificates)
        )
        if is_behind_nginx:
            site = (
                site_of_the_docs(port, [server.port], folder, tls=True)
                if is_tls
                # Debian 12's uvicorn refuses an `Upgrade` header without an upgrade.
                else plain_site(port, server.port, connection="$http_connection")
            )
            stack.enter_context(running_nginx(folder / "nginx", site, port))
        else:
            address = server.address

        def paired() -> Browser:
            one = pairing.redeem(invitation, 0.0)
            cookie = f"{cookie_name(config)}={one.secret}"
            return Browser(f"{address}/", cookie, trust if is_tls else None)

        yield paired
