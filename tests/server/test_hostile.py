"""Hostile values at every address of the API: answered with 4xx, never 5xx, and memory stays
small."""

from __future__ import annotations

import itertools
import json
import random
import resource
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.access.config import NetworkLimits
from server.config import Config
from tests.kit.sizes import IS_FULL

from .virtual_server import WEB, VirtualServer

EVERY = 1 if IS_FULL else 9
"""CI sends every body to every address; `make test` sends every ninth."""
MOST_GROWTH_BYTES = 150_000_000
VALUES: list[Any] = [
    "\ud83d",
    "default-999999",
    float("nan"),
    float("inf"),
    "x" * 10_000,
    "",
    "\0",
    "../../etc/passwd",
    -1,
    0,
    10**30,
    1e308,
    True,
    None,
    [],
    {},
    [[]] * 3,
    {"a": {"b": []}},
]
FIELDS = (
    "name",
    "learner",
    "place",
    "undo",
    "title",
    "protected",
    "verb",
    "first",
    "last",
    "label",
    "value",
    "seconds",
    "speed",
    "max_nodes",
    "moves",
    "trial",
    "teach_s",
    "answer",
    "token",
    "colour",
    "participant",
)
BODIES: list[bytes] = [b"", b"[]", b"null", b"{", b"\xff\xfe", b"[" * 50_000, b'"x"', b"1e999"]
PARTS = ["%00", "%ed%a0%bd", "..%2f..%2fetc", "x" * 1_000, "-1", "99999999999999999999", "a"]


@pytest.fixture
def address(tmp_path: Path) -> Iterator[str]:
    limits = NetworkLimits(requests_per_second=1e6, requests_burst=1e6)
    config = Config(port=0, web=WEB, data=tmp_path, limits=limits)
    with VirtualServer(config, data=tmp_path) as server:
        yield server.address


def _operations(address: str) -> list[tuple[str, str]]:
    paths = httpx.get(address + "/openapi.json").json()["paths"]
    return [
        (method.upper(), path)
        for path, item in paths.items()
        for method in item
        if path != "/api/stop" and "mjpg" not in path
    ]


def _paths(path: str) -> list[str]:
    parts = path.split("/")
    if not any(part.startswith("{") for part in parts):
        return [path]
    return ["/".join(p if part.startswith("{") else part for part in parts) for p in PARTS]


def _bodies(operation: str) -> Iterator[bytes]:
    """Invalid bodies, each value in all fields at once, and some values in each field."""
    dice = random.Random(operation)
    yield from BODIES
    for value in VALUES:
        yield json.dumps(dict.fromkeys(FIELDS, value)).encode()
    for field in FIELDS:
        for value in dice.sample(VALUES, 4):
            yield json.dumps({field: value}).encode()
    yield b'{"learner": "default-999999"}'


def test_no_value_makes_the_server_fail(address: str) -> None:
    operations = _operations(address)
    assert len(operations) > 30
    failures, before_bytes = [], _peak_bytes()
    with httpx.Client(timeout=30) as client:
        for method, template in operations:
            first = _paths(template)[0]
            for path in _paths(template):
                bodies = [b""] if method in ("GET", "DELETE") else list(_bodies(method + template))
                for body in bodies[::EVERY] if path == first else bodies[:12:EVERY]:
                    try:
                        answer = client.request(method, address + path, content=body)
                    except httpx.TransportError as error:
                        failures.append((method, path[:60], body[:80], str(error)))
                        continue
                    if answer.status_code >= 500 and answer.status_code not in (503, 507):
                        failures.append((method, path, body[:80], answer.status_code))
    assert failures == [], "\n".join(map(repr, failures))
    assert _peak_bytes() - before_bytes < MOST_GROWTH_BYTES


def test_hostile_queries_are_refused(address: str) -> None:
    failures = []
    with httpx.Client(timeout=30) as client:
        for method, template in _operations(address):
            if method != "GET":
                continue
            for name, value in itertools.product(
                ("seconds", "count", "first", "last"), ("nan", "inf", "-1", "1e999", "x", "9" * 400)
            ):
                path = _paths(template)[-1]
                answer = client.get(address + path, params={name: value})
                if answer.status_code >= 500 and answer.status_code != 503:
                    failures.append((path, name, value, answer.status_code))
    assert failures == []


def _peak_bytes() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
