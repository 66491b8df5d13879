"""Behind a real nginx (plain, under paths, with TLS there) and Caddy: page, sockets and STOP."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.access.config import NetworkConfig, PublicAddress, read_networks
from server.access.pairing import Pairing
from server.config import Config
from server.gateway.roles import Role
from tests.joined_page import joined_page
from tests.kit.ports import free_port
from tests.kit.sizes import few
from tests.kit.wait import wait_until
from tests.server.live_robot import WEB, LiveServer, live_server

from .nginx import plain_site, running_caddy, running_nginx, site_of_the_docs
from .world import PHONE

pytestmark = pytest.mark.browser
LAYOUTS = {
    "two robots, TLS at the proxy": [
        "https://localhost:{port}/rover",
        "https://localhost:{port}/scout",
    ],
    "two robots, Caddy": ["https://localhost:{port}/rover", "https://localhost:{port}/scout"],
    "under a path": ["http://localhost:{port}/rover"],
    "plain": ["http://127.0.0.1:{port}"],
}


@pytest.mark.parametrize("layout", few(LAYOUTS, 1))
def test_the_page_its_websockets_and_stop_work_behind_a_proxy(
    layout: str, tmp_path: Path, chromium: Any
) -> None:
    port = free_port()
    addresses = [address.format(port=port) for address in LAYOUTS[layout]]
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
            server = stack.enter_context(live_server(config, pairing=pairing))
            robots.append((address, server, pairing))
        ports = [server.port for _, server, _ in robots]
        folder = tmp_path / "proxy"
        if "Caddy" in layout:
            stack.enter_context(running_caddy(folder, ports, port))
        elif layout == "plain":
            stack.enter_context(running_nginx(folder, plain_site(port, ports[0]), port))
        else:
            site = site_of_the_docs(port, ports, tmp_path, tls="TLS" in layout)
            stack.enter_context(running_nginx(folder, site, port))
        context = chromium.new_context(viewport=PHONE, has_touch=True, ignore_https_errors=True)
        stack.callback(context.close)
        pages = [_paired(context, *robot) for robot in robots]
        for page, (address, server, _) in zip(pages, robots, strict=True):
            _judge(page, address, server)
            _judge_strangers(address, server)
        assert len({page.url for page in pages}) == len(robots)


def _paired(context: Any, address: str, server: LiveServer, pairing: Pairing) -> Any:
    """Return the page of a browser that has scanned the code in the terminal."""
    page = context.new_page()
    page.goto(f"{address}/")
    assert page.url.startswith(f"{address}/pair"), "a stranger is led to the pairing page"
    page.goto(f"{address}/pair#{pairing.tokens[Role.PILOT]}")
    page.wait_for_url(f"{address}/")
    return page


def _judge(page: Any, address: str, server: LiveServer) -> None:
    """Check that this page shows and stops its own robot, in both ways, and stays within its
    path."""
    page.wait_for_selector("video-view[data-frames]", state="attached", timeout=60_000)
    stops = server.rig.loop.state.stops
    assert not server.rig.loop.state.emergency
    page.locator(".stop:visible").click()
    wait_until(lambda: server.rig.loop.state.emergency, "STOP on the socket")
    server.rig.loop.release_emergency().result(60)
    status = "fetch('api/stop', { method: 'POST' }).then((answer) => answer.status)"
    assert page.evaluate(status) == 200
    wait_until(lambda: server.rig.loop.state.emergency, f"STOP over HTTP, after {dict(stops)}")
    page.evaluate("location.hash = 'settings'")
    page.wait_for_selector("settings-screen input[type=range]")
    if page.evaluate("isSecureContext") and address.startswith("http:"):
        scope = page.evaluate("navigator.serviceWorker.ready.then((worker) => worker.scope)")
        assert scope == f"{address}/"


def _judge_strangers(address: str, server: LiveServer) -> None:
    """Check that nobody without pairing gets anything, with any forged headers."""
    made_up = {
        "X-Forwarded-For": "127.0.0.1",
        "X-Forwarded-Host": "localhost",
        "Forwarded": "for=127.0.0.1",
    }
    for headers in ({}, made_up):
        for path in ("/metrics", "/api/why"):
            answer = httpx.get(address + path, headers=headers, verify=False)
            assert answer.status_code in (400, 401), answer.text
            direct = httpx.get(server.address + path, headers=headers)
            assert direct.status_code in (400, 401), direct.text


@pytest.mark.parametrize("method", ["GET", "POST"])
def test_without_the_setting_the_robot_says_what_to_set(method: str, tmp_path: Path) -> None:
    port = free_port()
    with (
        live_server(Config(port=0, web=WEB)) as server,
        running_nginx(tmp_path / "nginx", plain_site(port, server.port), port),
    ):
        origin = f"http://127.0.0.1:{port}"
        headers = {"X-Forwarded-For": "10.0.0.1"} if method == "GET" else {"Origin": origin}
        answer = httpx.request(method, f"{origin}/api/stop", headers=headers)
        assert answer.status_code == 403
        detail = answer.json()["detail"]
        assert next(iter(headers)) in detail and "--behind-proxy" in detail
