"""Paired browsers behind one address load the page at once: how many pages stay dead?

Each browser has six connections, like a real one, and requests what a first visit needs: the
document, its files, its service worker, both websockets and a first picture. No request is
repeated.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
import ssl
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urljoin, urlsplit

import pytest

from server.access.certificates import Certificates
from server.access.config import NetworkConfig, PublicAddress, read_networks
from server.access.pairing import Paired, Pairing, cookie_name
from tests.e2e.nginx import plain_site, running_nginx, site_of_the_docs
from tests.joined_page import joined_page
from tests.kit.ports import free_port

from .live_robot import live_server

LINES = 6
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
            Exception: Of whatever fails first.
        """
        lines: asyncio.Queue[Any] = asyncio.Queue()
        for _ in range(LINES):
            lines.put_nowait(None)
        html = await self._get(lines, "")
        done, wanted = {""}, {*self._named(html), "sw.js", "manifest.webmanifest"}
        sockets = asyncio.create_task(self._see())
        while wanted:
            got = await asyncio.gather(*(self._get(lines, path) for path in sorted(wanted)))
            done |= wanted
            wanted = {name for text in got for name in self._named(text)} - done
        await sockets
        while not lines.empty():
            line = lines.get_nowait()
            if line is not None:
                line[1].transport.abort()

    def _named(self, text: str) -> list[str]:
        found = _NAMED.findall(text)
        return [name.lstrip("/") for name in found if name.count("-") or "icons" not in name]

    async def _get(self, lines: asyncio.Queue[Any], path: str) -> str:
        url = urlsplit(urljoin(self.address, path))
        words = f"GET {url.path} HTTP/1.1\r\nHost: {url.netloc}\r\nCookie: {self.cookie}\r\n"
        line, head = await lines.get(), ""
        while not head:
            is_new = line is None
            line = line or await asyncio.open_connection(url.hostname, url.port, ssl=self.trust)
            reader, writer = line
            writer.write(f"{words}Accept: */*\r\n\r\n".encode())
            try:
                head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1")
            except (asyncio.IncompleteReadError, ConnectionError):
                if is_new:
                    raise
                # A server may close an idle connection at that moment; browsers then repeat the
                # request on a new one.
                writer.transport.abort()
                line = None
        assert head.startswith("HTTP/1.1 200"), (path, head)
        length = re.search(r"content-length: (\d+)", head, re.I)
        if length is not None:
            body = await reader.readexactly(int(length[1]))
        else:
            body = b""
            while size := int(await reader.readline(), 16):
                body += (await reader.readexactly(size + 2))[:-2]
            await reader.readline()
        if "connection: close" in head.lower():
            writer.transport.abort()
            line = None
        lines.put_nowait(line)
        return body.decode("utf-8", "replace")

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
    await asyncio.sleep(0)  # aborted connections are closed in the loop's next turn
    return [repr(one)[:300] for one in ended if one is not None]


WAYS = ("http", "TLS", "http through nginx", "TLS through nginx")


def check_nobody_s_page_is_dead(
    tmp_path: Path, certificates: Certificates | None, count: int, ways: Sequence[str] = WAYS
) -> dict[str, int]:
    """Count the dead pages: over http and TLS, without nginx and through it."""
    pytest.importorskip("websockets.asyncio.client", reason="Debian 12's websockets has it not")
    found = {}
    for way in ways:
        folder = tmp_path / way.replace(" ", "-")
        folder.mkdir()
        with _serving(way, folder, certificates) as browsers_of:
            dead = asyncio.run(dead_pages(browsers_of(count)))
        assert dead == [], (way, len(dead), dead[:3])
        found[way] = len(dead)
    return found


@contextlib.contextmanager
def _serving(way: str, folder: Path, certificates: Certificates) -> Iterator[Any]:
    pairing = Pairing(10)
    invitation, _ = pairing.invite(0.0)

    def paired() -> str:
        one = pairing.redeem(invitation, 0.0)
        assert isinstance(one, Paired)
        return f"{cookie_name(config)}={one.secret}"

    with contextlib.ExitStack() as stack:
        config = NetworkConfig(
            port=0, web=joined_page(), lan=True, host="127.0.0.1", data=folder, tls=way == "TLS"
        )
        trust = ssl.create_default_context()
        trust.check_hostname, trust.verify_mode = False, ssl.CERT_NONE
        if "nginx" in way:
            port = free_port()
            address = f"{'https' if 'TLS' in way else 'http'}://localhost:{port}"
            address += "/rover" if "TLS" in way else ""
            public = (PublicAddress.parse(address),)
            config = NetworkConfig(
                port=0,
                web=joined_page(),
                data=folder,
                public=public,
                proxies=read_networks("127.0.0.1"),
            )
        own = certificates if way == "TLS" else None
        server = stack.enter_context(live_server(config, pairing=pairing, certificates=own))
        if "nginx" in way:
            site = (
                site_of_the_docs(port, [server.port], folder, tls=True)
                if "TLS" in way
                # The uvicorn of Debian 12 refuses requests with an `Upgrade` header that are not an
                # upgrade.
                else plain_site(port, server.port, connection="$http_connection")
            )
            stack.enter_context(running_nginx(folder / "nginx", site, port))
        else:
            address = server.address
        at = f"{address}/"
        context = trust if at.startswith("https") else None
        yield lambda count: [Browser(at, paired(), context) for _ in range(count)]
