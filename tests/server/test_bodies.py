"""The error for a person whose `curl` request does not declare its body as JSON."""

from __future__ import annotations

import re
from pathlib import Path

import httpx

from robot import __version__

from .virtual_server import VirtualServer


def test_a_body_that_does_not_say_that_it_is_json_is_told_how_to(tmp_path: Path) -> None:
    with VirtualServer(data=tmp_path) as server:
        for kind in ("application/x-www-form-urlencoded", "text/plain"):
            told = refusals(server, kind)
            assert len(told) > 15
            assert {sentence for sentence in told if "Content-Type" not in sentence} == set()


def refusals(server: VirtualServer, kind: str) -> list[str]:
    """Return the answer of each route that takes JSON to a body of another kind."""
    described = httpx.get(f"{server.address}/openapi.json").json()["paths"]
    routes = [
        (method, re.sub(r"{\w+}", "1", path))
        for path, methods in described.items()
        for method, route in methods.items()
        if "application/json" in route.get("requestBody", {}).get("content", {})
    ]
    headers = {"content-type": kind}
    answers = [
        httpx.request(method, server.address + path, content=b"{}", headers=headers)
        for method, path in routes
    ]
    assert [answer for answer in answers if answer.is_success] == []
    return [answer.json()["detail"] for answer in answers if answer.status_code == 400]


def test_a_body_that_says_it_is_told_what_is_wrong_in_it(server: VirtualServer) -> None:
    address = f"{server.address}/api/teaching/undo"
    for value, wanted in (([1], "a JSON object"), ({"seconds": 99}, "'seconds' must be")):
        answer = httpx.post(address, json=value)
        assert (answer.status_code, wanted in answer.json()["detail"]) == (400, True), answer.text


def test_the_openapi_description_names_this_version(server: VirtualServer) -> None:
    described = httpx.get(f"{server.address}/openapi.json").json()
    assert described["info"]["version"] == __version__
