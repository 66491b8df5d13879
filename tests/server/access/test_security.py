"""A server refuses what the guard forbids, each time with the right status."""

import contextlib
import dataclasses
import itertools
import re
from typing import Any

import httpx
import pytest
from fastapi.routing import APIRoute
from websockets.exceptions import InvalidStatus

from server.access.config import NetworkConfig, NetworkLimits
from server.access.pairing import Pairing, cookie_name
from server.app import ROUTERS
from server.config import Config, Limits
from server.gateway.roles import Role
from tests.server.live_robot import WEB
from tests.server.virtual_connections import Exchange
from tests.server.virtual_server import VirtualPilot, VirtualServer, connect


@pytest.fixture(scope="module")
def here():
    with VirtualServer(
        Config(port=0, web=WEB, limits=NetworkLimits(requests_burst=5000))
    ) as running:
        yield running


@pytest.fixture
def lan(tmp_path):
    limits = NetworkLimits(pairing_failures=3)
    config = NetworkConfig(port=0, web=WEB, lan=True, limits=limits, data=tmp_path)
    pairing = Pairing(limits.pairing_failures, file=tmp_path / "paired.json")
    with VirtualServer(config, pairing=pairing) as running:
        yield running


def _socket_status(server: VirtualServer, path: str = "/ws/drive", **headers: str) -> int:
    """Open a websocket; return 101 if it was admitted."""
    options: dict[str, Any] = {"additional_headers": headers, "compression": None}
    try:
        with connect(server.ws(path), **options):
            return 101
    except InvalidStatus as refused:
        return refused.response.status_code


def _routes(server: VirtualServer) -> set[tuple[str, str]]:
    """Return the method and path of every route, including those of extensions."""
    added = (router for each in server.services.extensions.values() for router in each.routers)
    return {
        (method, route.path)
        for router in (*ROUTERS, *added)
        for route in router.routes
        if isinstance(route, APIRoute)
        for method in route.methods
    }


def _pair(server: VirtualServer, role: Role) -> dict[str, str]:
    """Pair a new browser; return its cookie header."""
    token = server.services.gateway.pairing.tokens[role]
    answer = httpx.post(server.address + "/api/pair", json={"token": token})
    assert answer.json()["role"] == role.value
    return {"cookie": answer.headers["set-cookie"].split(";")[0]}


# On loopback -----------------------------------------------------------------------------------


LINK = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate"}
"""The headers of a browser's request after a click on a link of another site."""


@pytest.mark.parametrize(
    ("method", "path", "headers", "status"),
    [
        ("GET", "/", {"host": "evil.example:8000"}, 421),  # DNS rebinding
        ("GET", "/", {"host": ""}, 421),
        ("GET", "/", {"host": "127.0.0.1.evil.example"}, 421),
        ("GET", "/", {"sec-fetch-site": "cross-site"}, 403),
        ("GET", "/", {"sec-fetch-site": "same-site"}, 403),
        ("POST", "/api/pair", {"origin": "http://evil.example"}, 403),
        ("GET", "/", LINK, 200),
        *((method, "/api/settings", LINK, 403) for method in ("POST", "PUT", "PATCH", "DELETE")),
    ],
)
def test_requests_for_other_names_and_of_other_sites_are_refused(
    here, method, path, headers, status
):
    answer = httpx.request(method, here.address + path, headers=headers)
    assert answer.status_code == status
    assert status != 403 or answer.json()["error"] == "origin"


@pytest.mark.parametrize("path", ["/ws/drive", "/ws/video"])
def test_cross_site_websocket_hijacking_is_refused(here, path):
    for origin in ("http://evil.example", "null", "https://127.0.0.1", "http://127.0.0.1:1"):
        assert _socket_status(here, path, origin=origin) == 403
    assert _socket_status(here, path, host="evil.example") == 421, "DNS rebinding is refused"
    assert _socket_status(here, path, origin=here.address) == 101, "our own page is admitted"


def test_large_bodies_are_refused_with_and_without_a_length(tmp_path):
    config = Config(port=0, web=WEB, limits=Limits(upload_bytes=2000))
    with VirtualServer(config, data=tmp_path) as server:
        body = b"x" * 1_000_001
        assert httpx.post(server.address + "/api/pair", content=body).status_code == 413
        parts = itertools.repeat(b"x" * 500, 9)
        answer = httpx.put(server.address + "/api/models/Kitchen/file", content=parts)
        assert (answer.status_code, answer.json()["error"]) == (413, "size")


def test_no_path_leads_out_of_the_page(here):
    files = ("/../pyproject.toml", "/%2e%2e/pyproject.toml", "/..%2fpyproject.toml")
    for path in (*files, "/%00", "//etc/passwd"):
        answer = here.get_raw(path)
        assert answer.status_code in (400, 404), path
        assert b"drivelesson" not in answer.read().lower()


def test_the_page_may_load_nothing_from_elsewhere(here):
    headers = httpx.get(here.address).headers
    parts = headers["content-security-policy"].split(";")
    policy = dict(part.strip().split(" ", 1) for part in parts)
    assert policy["default-src"] == "'none'"
    assert policy["script-src"] == policy["style-src"]
    own, *inline = policy["script-src"].split()
    assert own == "'self'"
    assert all(source.startswith("'sha256-") for source in inline)
    assert policy["frame-ancestors"] == policy["base-uri"] == "'none'"
    assert "unsafe" not in headers["content-security-policy"]
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "same-origin", "STOP is a form, which needs its origin"
    assert httpx.get(here.address + "/healthz").headers["referrer-policy"] == "no-referrer"


def test_no_page_has_script_or_style_inside_but_the_first_one():
    """The inline script and style of this page are allowed by their hashes
    (tests/web/test_bundle.py)."""
    for page in WEB.rglob("*.html"):
        text = page.read_text().lower()
        inside = int(page == WEB / "index.html")
        assert " style=" not in text and " onclick=" not in text
        assert text.count("<style") == inside
        assert text.count("<script") == text.count('<script type="module" src=') + inside, page


def test_when_all_slots_are_taken_a_newcomer_evicts_the_person_with_the_most(tmp_path):
    limits = NetworkLimits(clients=4, clients_each=3)
    config = NetworkConfig(port=0, web=WEB, lan=True, limits=limits, data=tmp_path)
    with VirtualServer(config, pairing=Pairing(3)) as server, contextlib.ExitStack() as stack:
        roles = (Role.PILOT, *3 * [Role.VIEWER])
        owner, greedy, second, third = (_pair(server, role) for role in roles)

        def page(cookie):
            socket = connect(server.ws("/ws/drive"), additional_headers=cookie)
            server.forward(0.1)  # time to close an evicted websocket
            return stack.enter_context(socket)

        many = [page(greedy) for _ in range(5)]
        assert [one.close_code for one in many] == [1013, 1013, None, None, None]
        page(second)
        page(third)  # the client with the most connections loses one
        assert many[2].close_code == 1013
        assert _socket_status(server, **third) == 503, "all others have as few connections"
        page(owner)
        assert many[3].close_code == 1013, "the owner evicts a client with more connections"


def test_uploads_that_never_end_use_the_memory_of_only_two(tmp_path):
    """In an earlier version, one pupil could keep an upload of 64 MB open on each connection."""
    config = NetworkConfig(port=0, web=WEB, lan=True, data=tmp_path)
    with VirtualServer(config, pairing=Pairing(3), data=tmp_path) as server:
        owner, *pupils = (_pair(server, Role.PILOT) for _ in range(4))

        def begin(cookie):
            async def ask():
                path = f"{server.address}/api/models/mine/file"
                request = httpx.Request("PUT", path, content=b"x", headers=cookie)
                exchange = Exchange(server, request, None)
                exchange._incoming.get_nowait()  # the end of the body never arrives
                return exchange

            exchange = server.run(ask())
            server.forward(0.1)
            return exchange

        first, again, other = begin(pupils[0]), begin(pupils[0]), begin(pupils[1])
        assert first.task.done() and not again.task.done() and not other.task.done()
        assert begin(pupils[2]).status == 503
        third = begin(owner)
        assert not third.task.done() and again.task.done() != other.task.done()
        for exchange in (again, other, third):
            exchange.hang_up()
        server.wait_until(lambda: server.services.gateway.admission.uploads.taken == 0)


def test_too_many_requests_are_refused(tmp_path):
    limits = NetworkLimits(requests_burst=10, requests_per_second=1)
    config = NetworkConfig(port=0, web=WEB, lan=True, limits=limits, data=tmp_path)
    with VirtualServer(config, pairing=Pairing(3)) as server, httpx.Client() as client:
        statuses = [client.get(server.address + "/healthz").status_code for _ in range(12)]
        assert statuses[:10] == [200] * 10
        assert statuses[-1] == 429


def test_a_client_with_too_many_messages_is_refused_and_then_disconnected():
    limits = Limits(messages_per_second=5, messages_burst=5, refused_before_closing=20)
    with VirtualServer(Config(port=0, web=WEB, limits=limits)) as server, server.pilot() as pilot:
        for _ in range(10):
            pilot.send(type="ping", client_ms=1)
        pilot.wait_for(lambda m: m.get("code") == "too_fast")
        for _ in range(40):
            pilot.send(type="ping", client_ms=1)
        server.wait_until(lambda: pilot.socket.is_closed)
        assert pilot.socket.close_code == 1008


# On the local network --------------------------------------------------------------------------


ANSWERED = {
    ("GET", "/healthz"): (200, {"status"}),
    ("GET", "/pair"): (200, None),
    ("GET", "/pair#{token}"): (303, None),
    ("POST", "/api/pair"): (403, {"error", "detail"}),
    ("GET", "/ca.crt"): (404, {"detail"}),
    ("POST", "/api/class/hello"): (400, {"detail"}),
    ("POST", "/api/class/join"): (400, {"detail"}),
    ("GET", "/pair/pair.js"): (200, None),
    ("GET", "/pair/pair.css"): (200, None),
    ("GET", "/favicon.ico"): (404, {"detail"}),
    ("GET", "/manifest.webmanifest"): (200, None),
}
"""The addresses that an unpaired client may read; all other addresses answer 401."""


def test_an_unpaired_client_gets_nothing_else(lan):
    routes = _routes(lan)
    routes |= {("GET", path) for path in ("/", "/index.html", "/js/main.js", "/openapi.json")}
    unlike = {}
    for method, path in sorted(routes | ANSWERED.keys()):
        address = re.sub(r"{[^}]*}", "x", path).replace("#", "%23")
        answer = httpx.request(method, lan.address + address, json={"token": "wrong"})
        is_json = "json" in answer.headers.get("content-type", "").partition(";")[0]
        names = set(answer.json()) if is_json and answer.status_code != 200 else None
        names = set(answer.json()) if path == "/healthz" else names
        wanted = ANSWERED.get((method, path), (401, {"error", "detail"}))
        if (answer.status_code, names) != wanted:
            unlike[method, path] = (answer.status_code, names)
    assert len(routes) > 60
    assert unlike == {}
    guess = f"{cookie_name(lan.services.config)}=guess"
    for path in ("/ws/drive", "/ws/video"):
        assert _socket_status(lan, path) == _socket_status(lan, path, cookie=guess) == 401


def test_an_unpaired_browser_is_redirected_to_the_pairing_page(lan):
    answer = httpx.get(lan.address, headers={"accept": "text/html"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/pair")
    # An app may have put the token into the path.
    answer = httpx.get(lan.address + "/pair%23ABCD-EFGH")
    assert (answer.status_code, answer.headers["location"]) == (303, "pair#ABCD-EFGH")
    forged = httpx.get(lan.address + "/pair%23a%0d%0ab: c")
    assert forged.headers["location"] == "pair#a%0D%0Ab%3A%20c"


def test_a_token_lets_one_browser_in_once(lan):
    token = lan.services.gateway.pairing.tokens[Role.PILOT]
    answer = httpx.post(lan.address + "/api/pair", json={"token": token.lower()})
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie and "samesite=strict" in cookie.lower()
    again = httpx.post(lan.address + "/api/pair", json={"token": token})
    assert again.status_code == 403
    value = cookie.split(";")[0]
    assert httpx.get(lan.address, headers={"cookie": value}).status_code == 200
    assert _socket_status(lan, cookie=value) == 101


def test_guessing_tokens_is_soon_refused_and_nonsense_is_not_taken_for_one(lan):
    for body in (b"", b"[]", b'{"token": 1}', b"\xff", b"[" * 100_000):
        assert httpx.post(lan.address + "/api/pair", content=body).status_code == 400
    guess = {"token": "AAAA-AAAA-AAAA-AAAA"}
    statuses = [httpx.post(lan.address + "/api/pair", json=guess).status_code for _ in range(4)]
    assert statuses == [403, 403, 403, 429]
    right = {"token": lan.services.gateway.pairing.tokens[Role.PILOT]}
    assert httpx.post(lan.address + "/api/pair", json=right).status_code == 200


def test_a_viewer_may_stop_but_not_drive(lan):
    with VirtualPilot(lan, headers=_pair(lan, Role.VIEWER)) as viewer:
        assert viewer.hello["role"] == "viewer"
        viewer.send(type="take")
        viewer.wait_for(lambda m: m.get("code") == "not_pilot")
        viewer.mode("train")
        viewer.send(type="stop")
        state = viewer.wait_for_state(emergency=True)
        assert state["mode"] == "stopped" and state["pilot"] is None


def test_a_viewer_can_change_only_its_own_pairing(lan):
    viewer, described = _pair(lan, Role.VIEWER), lan.app.openapi()["paths"]
    allowed = set()
    for path in sorted(described, key="/api/unpair".__eq__):  # this request ends the session
        for method in set(described[path]) - {"get"}:
            answer = httpx.request(method, lan.address + path, headers=viewer)
            if answer.status_code != 403:
                allowed.add(path)
    assert len(described) > 30, "the routes of extensions are included"
    assert allowed == {"/api/stop", "/api/pair", "/api/unpair"} | (CLASS_PATHS & described.keys())


CLASS_PATHS = {"/api/class/hello", "/api/class/join"}
"""Paths without a session, because a board proves its identity in these requests."""


@pytest.mark.parametrize(
    ("path", "role", "stays"),
    [
        ("/api/unpair", Role.PILOT, False),
        ("/api/pair", Role.VIEWER, False),  # the browser loses rights
        ("/api/pair", Role.PILOT, True),
    ],
)
def test_after_unpairing_no_other_tab_can_drive(lan, path, role, stays):
    cookie, body = _pair(lan, Role.PILOT), {"token": lan.services.gateway.pairing.tokens[role]}
    with connect(lan.ws("/ws/drive"), additional_headers=cookie):
        lan.wait_until(lambda: bool(lan.hub.broadcast.clients))
        assert httpx.post(lan.address + path, json=body, headers=cookie).status_code == 200
        lan.forward(1.0)
        assert bool(lan.hub.broadcast.clients) is stays
    status = httpx.get(lan.address, headers=cookie).status_code
    assert status == (200 if stays else 401)


def test_pairings_outlive_a_restart_as_hashes_only(lan, tmp_path):
    secret = _pair(lan, Role.PILOT)["cookie"].partition("=")[2]
    file = tmp_path / "paired.json"
    assert secret not in file.read_text()
    assert file.stat().st_mode & 0o077 == 0
    session = Pairing(3, file=file).find(secret)
    assert session is not None and session.role is Role.PILOT


def test_an_open_robot_cannot_be_put_on_the_network():
    with pytest.raises(ValueError, match="--lan"):
        NetworkConfig(host="0.0.0.0")
    assert dataclasses.replace(NetworkConfig(), host="0.0.0.0", lan=True).lan
