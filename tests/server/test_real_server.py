"""Real sockets and threads work, with and without TLS; no test checks their speed.

Further tests are in test_drive.py and test_security.py.
"""

import asyncio
import datetime as dt
import os
import ssl

import httpx
import pytest
from websockets.asyncio.client import connect

from robot.types import Action
from server.access.certificates import make_certificates
from server.access.config import NetworkConfig
from server.access.pairing import Pairing
from server.gateway.roles import Role
from tests.kit.wait import wait_until

from .live_robot import WEB, Pilot, live_server

pytestmark = pytest.mark.realtime


def test_a_pilot_drives_and_the_robot_stands_when_it_vanishes():
    with live_server() as server:
        assert httpx.get(server.address + "/healthz").json()["status"] == "ok"
        with Pilot(server.ws("/ws/drive"), sees=True) as pilot:
            pilot.wait_for_state(you_are_pilot=True)
            pilot.drive_until(lambda: server.driver.now is Action.FORWARD)
            assert pilot.picture is not None
            pilot.vanish()
            wait_until(lambda: server.driver.now is Action.STOP, "the robot stands")
        with server.pilot() as pilot:
            pilot.socket.send("x" * 70_000)
            pilot._threads[0].join(60.0)
            assert pilot.socket.close_code == 1009, "a huge message closes the socket"
        wait_until(lambda: not server.hub.broadcast.clients, "the client is gone")


def test_tls_with_an_authority_of_our_own(tmp_path):
    now = dt.datetime.now(dt.UTC)
    names = ["localhost", "127.0.0.1", "drivelesson.local", "a.public.example"]
    certificates = make_certificates(tmp_path / "tls", names, now)
    again = make_certificates(tmp_path / "tls", names, now)
    assert again.authority.read_bytes() == certificates.authority.read_bytes()
    if os.name != "nt":  # Windows has no permission bits
        assert certificates.key.stat().st_mode & 0o077 == 0
    trust = ssl.create_default_context(cafile=str(certificates.authority))
    config = NetworkConfig(port=0, web=WEB, lan=True, tls=True, data=tmp_path)
    pairing = Pairing(3)
    with live_server(config, pairing=pairing, certificates=certificates) as server:
        with httpx.Client(verify=trust, base_url=server.address) as browser:
            assert browser.get("/ca.crt").content == certificates.authority.read_bytes()
            answer = browser.post("/api/pair", json={"token": pairing.tokens[Role.PILOT]})
            cookie = answer.headers["set-cookie"]
            assert cookie.startswith("__Host-") and "Secure" in cookie
        url = server.address.replace("https", "wss") + "/ws/drive"
        headers = {"cookie": cookie.split(";")[0], "origin": server.address}
        assert '"hello"' in asyncio.run(_first_message(url, headers, trust))


async def _first_message(url: str, headers: dict[str, str], trust: ssl.SSLContext) -> str:
    """This test does not use `websockets.sync`, which reads and writes one TLS session from two
    threads: Python 3.11 then loses one or two of a thousand requests."""
    async with connect(url, ssl=trust, additional_headers=headers, compression=None) as socket:
        return str(await socket.recv())
