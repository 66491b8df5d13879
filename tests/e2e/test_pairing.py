"""A phone that scans the code in the terminal is paired; any other phone is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from server.access.config import NetworkConfig
from server.access.pairing import Pairing
from server.gateway.roles import Role
from tests.e2e.world import PHONE
from tests.server.live_robot import WEB, live_server

pytestmark = pytest.mark.browser


def test_scanning_the_code_pairs_the_browser(tmp_path: Path, chromium: Any) -> None:
    pairing = Pairing(10)
    config = NetworkConfig(port=0, web=WEB, lan=True, data=tmp_path)
    with live_server(config, pairing=pairing) as server:
        context = chromium.new_context(viewport=PHONE, has_touch=True)
        page = context.new_page()
        complaints: list[str] = []
        page.on("console", lambda message: _note(complaints, message))
        page.goto(server.address)
        assert page.url.endswith("/pair"), "a stranger is led to the pairing page"
        page.fill("#token", "AAAA-AAAA-AAAA-AAAA")
        page.click("button")
        page.locator("#said", has_text="wrong").wait_for()
        page.goto(f"{server.address}/pair#{pairing.tokens[Role.PILOT]}")
        page.wait_for_url(server.address + "/")
        page.wait_for_selector("video-view[data-frames]", state="attached", timeout=40_000)
        assert server.hub.broadcast.clients
        assert "script" not in context.cookies()[0]["value"]
        assert context.cookies()[0]["httpOnly"] and context.cookies()[0]["sameSite"] == "Strict"
        assert [text for text in complaints if "Content Security Policy" in text] == []
        other = context.new_page()
        other.goto(server.address)
        other.wait_for_selector("video-view[data-frames]", state="attached", timeout=40_000)
        page.evaluate("fetch('api/unpair', { method: 'POST' })")
        for tab in (other, page):
            tab.bring_to_front()
            tab.wait_for_url(server.address + "/pair")
        context.close()


def _note(complaints: list[str], message: Any) -> None:
    if message.type == "error":
        complaints.append(message.text)
