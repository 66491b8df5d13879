"""Paired browsers get the page, its sockets and STOP, directly and behind a proxy.

The proxies are a real nginx and a real Caddy with the docs' files: two robots under paths, and TLS.
"""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import pytest

from server.access.config import NetworkConfig, PublicAddress, read_networks
from server.access.pairing import Pairing
from server.gateway.roles import Role
from tests.joined_page import joined_page
from tests.kit.ports import free_port
from tests.kit.sizes import few
from tests.kit.wait import wait_until
from tests.server.live_robot import WEB, LiveServer, live_server

from .nginx import running_caddy, running_nginx, site_of_the_docs
from .world import PHONE, new_context


@pytest.mark.parametrize("proxy", few(["nginx", "caddy"], 1))
def test_the_page_its_websockets_and_stop_work_behind_a_proxy(
    proxy: str, tmp_path: Path, chromium: Any
) -> None:
    port = free_port()
    addresses = [f"https://localhost:{port}/{name}" for name in ("rover", "scout")]
    with contextlib.ExitStack() as stack:
        robots = []
        for n, address in enumerate(addresses):
            pairing = Pairing(10)
            config = NetworkConfig(
                port=0,
                web=joined_page(),
                data=tmp_path / str(n),
                public=(PublicAddress.parse(address),),
                proxies=read_networks("127.0.0.1"),
            )
            robots.append((stack.enter_context(live_server(config, pairing=pairing)), pairing))
        ports = [server.port for server, _ in robots]
        if proxy == "caddy":
            stack.enter_context(running_caddy(tmp_path / "proxy", ports, port))
        else:
            site = site_of_the_docs(port, ports, tmp_path)
            stack.enter_context(running_nginx(tmp_path / "proxy", site, port))
        context = new_context(chromium, PHONE, ignore_https_errors=True)
        stack.callback(context.close)
        pages = []
        for address, (_, pairing) in zip(addresses, robots, strict=True):
            page = context.new_page()
            page.goto(f"{address}/")
            assert page.url.startswith(f"{address}/pair"), "an unpaired browser is redirected"
            page.goto(f"{address}/pair#{pairing.tokens[Role.PILOT]}")
            page.wait_for_url(f"{address}/")
            pages.append(page)
        for page, (server, _) in zip(pages, robots, strict=True):
            _judge(page, server)
        assert [page.url.partition("#")[0] for page in pages] == [f"{one}/" for one in addresses]


def _judge(page: Any, server: LiveServer) -> None:
    """Check that this page shows its own robot, and stops it by websocket and by request."""
    page.wait_for_selector("video-view[data-frames]", state="attached", timeout=60_000)
    assert not server.rig.loop.state.emergency
    page.locator(".stop:visible").click()
    wait_until(lambda: server.rig.loop.state.emergency, "STOP on the socket")
    server.rig.loop.release_emergency().result(60)
    status = "fetch('api/stop', { method: 'POST' }).then((answer) => answer.status)"
    assert page.evaluate(status) == 200
    wait_until(lambda: server.rig.loop.state.emergency, "STOP over HTTP")
    page.evaluate("location.hash = 'settings'")
    page.wait_for_selector("settings-screen input[type=range]")


def test_scanning_the_code_pairs_the_browser(tmp_path: Path, chromium: Any) -> None:
    pairing = Pairing(10)
    config = NetworkConfig(port=0, web=WEB, lan=True, data=tmp_path)
    with live_server(config, pairing=pairing) as server:
        context = new_context(chromium, PHONE)
        page = context.new_page()
        complaints: list[str] = []
        page.on("console", lambda m: complaints.append(m.text) if m.type == "error" else None)
        page.goto(server.address)
        assert page.url.endswith("/pair"), "an unpaired browser is sent to the pairing page"
        page.fill("#token", "AAAA-AAAA-AAAA-AAAA")
        page.click("button")
        page.locator("#said", has_text="wrong").wait_for()
        page.goto(f"{server.address}/pair#{pairing.tokens[Role.PILOT]}")
        page.wait_for_url(server.address + "/")
        page.wait_for_selector("video-view[data-frames]", state="attached", timeout=40_000)
        [cookie] = context.cookies()
        assert cookie["httpOnly"] and cookie["sameSite"] == "Strict"
        assert [text for text in complaints if "Content Security Policy" in text] == []
        other = context.new_page()
        other.goto(server.address)
        other.wait_for_selector("video-view[data-frames]", state="attached", timeout=40_000)
        page.evaluate("fetch('api/unpair', { method: 'POST' })")
        for tab in (other, page):
            tab.bring_to_front()
            tab.wait_for_url(server.address + "/pair")
        context.close()
