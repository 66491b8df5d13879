"""Nonsense values at every route: 4xx, never 5xx, the memory stays small, the server survives."""

from __future__ import annotations

import json
import random
import re
import resource
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import httpx
import pytest

from robot.store.folder import Storage
from server.access.config import NetworkLimits
from server.config import Config
from server.persistence import Persistence
from tests.kit.sizes import IS_FULL, combined, few
from tests.learners import installed
from tests.robot.recordings.drives import record_drive
from tests.robot.store.models.test_checking import good, malformed

from .virtual_server import WEB, VirtualServer

HALF_EMOJI = '"\\ud83d"'
VALUES = (
    HALF_EMOJI, '"Kitchen \\ud83d"', '"' + "x" * 10_000 + '"', "NaN", "Infinity", "-1", "1e400",
    "9" * 5_000, "null", "true", "[]", "{}", '[["x"]]', '""', '"default-999999"', '"../../x"',
    '"\\u0000"', "-0", '"CON"', '"\\u202e"',
)  # fmt: skip
REFUSED = [
    value
    for value in VALUES
    if "\\ud83d" in value or len(value) > 4_000 or value in ("NaN", "1e400", '"../../x"')
]
"""The values that almost no field accepts."""
NAMES = ("\ufffd", "x" * 3_000, "a\0b", "CON", "%", " ", "\U0001f600")
BODIES = [
    ("POST", "/api/models", "name"), ("POST", "/api/models", "learner"),
    ("POST", "/api/models", "place"), ("POST", "/api/models", "like"),
    ("POST", "/api/models/restore", "undo"),
    ("PATCH", "/api/models/bench", "name"), ("PATCH", "/api/models/bench", "place"),
    ("POST", "/api/models/bench/copy", "name"), ("POST", "/api/episodes/restore", "undo"),
    ("PATCH", "/api/episodes/ID", "title"), ("PATCH", "/api/episodes/ID", "protected"),
    ("POST", "/api/episodes/ID/edits", "verb"), ("POST", "/api/episodes/ID/edits", "first"),
    ("POST", "/api/episodes/ID/edits", "last"), ("POST", "/api/episodes/ID/edits", "label"),
    ("POST", "/api/teaching/undo", "seconds"),
]  # fmt: skip
EDIT = {"verb": "relabel", "first": 1, "last": 2, "label": "left"}
PATHS = [
    ("GET", "/api/models/NAME/preview"), ("GET", "/api/models/NAME/file"),
    ("POST", "/api/models/NAME/load"), ("DELETE", "/api/models/NAME"),
    ("GET", "/api/episodes/NAME"), ("GET", "/api/episodes/NAME/timeline"),
    ("GET", "/api/episodes/NAME/frames/1"), ("GET", "/api/episodes/NAME/file"),
    ("DELETE", "/api/episodes/NAME"), ("POST", "/api/episodes/NAME/compact"),
    ("GET", "/api/episodes/ID/frames/NAME"), ("GET", "/api/episodes/ID/timeline?count=NAME"),
    ("GET", "/api/teaching/last?seconds=NAME"),
]  # fmt: skip


class Robot:
    def __init__(self, client: httpx.Client, persistence: Persistence, episode: str) -> None:
        self.client, self.persistence, self.episode = client, persistence, episode

    def ask(self, method: str, path: str, content: bytes = b"") -> httpx.Response:
        return self.client.request(method, path.replace("ID", self.episode), content=content)


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    root: Path = tmp_path_factory.mktemp("hostile")
    episode = record_drive(Storage(root).folder("episodes"), frames=20).id
    limits = NetworkLimits(requests_per_second=1e6, requests_burst=1e6)
    config = Config(port=0, web=WEB, data=root, limits=limits)
    with (
        VirtualServer(config, data=root, name="bench") as server,
        httpx.Client(base_url=server.address, timeout=60) as client,
    ):
        client.post("/api/models/save")
        yield Robot(client, server.persistence, episode)


def body_of(path: str, field: str, value: str) -> bytes:
    rest: dict[str, Any] = EDIT if path.endswith("/edits") else {}
    inner = [f'"{key}": {json.dumps(own)}' for key, own in rest.items() if key != field]
    return ("{" + ", ".join([*inner, f'"{field}": {value}']) + "}").encode()


@pytest.mark.parametrize(("method", "path", "field"), BODIES)
def test_hostile_values_are_refused_and_nothing_breaks(
    robot: Robot, method: str, path: str, field: str
) -> None:
    for value in VALUES if IS_FULL else REFUSED:
        answer = robot.ask(method, path, body_of(path, field, value))
        assert answer.status_code < 500, (value[:40], answer.text[:200])
        if value in REFUSED:
            is_title = (field == "title" and value == '"../../x"') or field == "place"
            assert answer.status_code >= 400 or is_title, (value[:40], answer.text[:200])
        name = robot.client.get("/api/models").json()["current"]
        if path.startswith("/api/models/bench") and name != "bench":
            robot.client.patch(f"/api/models/{quote(name, safe='')}", json={"name": "bench"})
    assert robot.client.post("/api/models/save").status_code == 200
    assert robot.client.get("/api/episodes").status_code == 200


@pytest.mark.parametrize(("method", "path"), PATHS)
def test_hostile_names_are_4xx(robot: Robot, method: str, path: str) -> None:
    names = [quote(name, safe="") for name in NAMES] + [
        "%ED%A0%BD",
        "%FF%FE",
        "%2e%2e",
        "9" * 400,
        "nan",
    ]
    for name in names:
        if name == "%2e%2e" and "/ID/" in path:
            continue  # the client itself goes up
        answer = robot.ask(method, path.replace("NAME", name))
        is_count = "count=" in path or "first=" in path
        assert 400 <= answer.status_code < 500 or (is_count and answer.status_code == 200), (
            name[:40],
            answer.text[:200],
        )


def test_half_of_a_surrogate_pair_does_not_prevent_saving(robot: Robot) -> None:
    answer = robot.ask("PATCH", "/api/models/bench", b'{"place": "Kitchen \\ud83d"}')
    assert answer.status_code == 400
    assert robot.client.post("/api/models/save").status_code == 200


@pytest.mark.parametrize("learner", installed("published-4", "knn-3"))
def test_malformed_models_are_422_over_http(robot: Robot, learner: str) -> None:
    """Some of the models that tests/robot/store/models/test_checking.py generates, uploaded."""
    if learner.startswith("knn"):
        pytest.importorskip("sklearn", reason="kNN needs the extra `evaluate`")
    for what, data in malformed(learner, every=7):
        answer = robot.client.put("/api/models/x/file", content=data)
        assert answer.status_code == 422 and answer.json()["detail"], what
    assert robot.client.put("/api/models/y/file", content=good(learner)).status_code == 201


WHOLE = (b"", b"[]", b"null", b"{", b"\xff\xfe", b"[" * 50_000, b'"x"', b"1e999")
PARTS = ("%00", "%ed%a0%bd", "..%2f..%2fetc", "x" * 1_000, "-1", "9" * 20, "a")
MOST_GROWTH_BYTES = 150_000_000


def test_no_value_makes_a_described_route_fail(robot: Robot) -> None:
    described = robot.client.get("/openapi.json").json()
    operations = [
        (method.upper(), path, fields_of(described, operation))
        for path, item in described["paths"].items()
        for method, operation in item.items()
        if path != "/api/stop" and "mjpg" not in path
    ]
    assert len(operations) > 30 and sum(len(fields) for *_, fields in operations) > 30
    failures, before_bytes = [], peak_bytes()
    for method, template, fields in operations:
        dice = random.Random(method + template)
        bodies = [b""] if method in ("GET", "DELETE") else few(WHOLE, 3)
        bodies += [
            f'{{"{field}": {value}}}'.encode()
            for field in fields
            for value in (VALUES if IS_FULL else dice.sample(VALUES, 3))
        ]
        for path in few(dict.fromkeys(re.sub(r"{\w+}", part, template) for part in PARTS), 3):
            for body in bodies:
                answer = robot.client.request(method, path, content=body)
                if answer.status_code >= 500 and answer.status_code not in (503, 507):
                    failures.append((method, path[:60], body[:80], answer.status_code))
            bodies = bodies[:3]
        if method == "GET":
            for name, value in combined(("seconds", "count", "first", "last"), QUERIES):
                answer = robot.client.get(path, params={name: value})
                if answer.status_code >= 500 and answer.status_code != 503:
                    failures.append((path, name, value, answer.status_code))
    assert failures == []
    assert peak_bytes() - before_bytes < MOST_GROWTH_BYTES


QUERIES = ("nan", "inf", "-1", "1e999", "x", "9" * 400)


def fields_of(described: dict[str, Any], operation: dict[str, Any]) -> list[str]:
    """Return the fields of the JSON that an operation takes."""
    content = operation.get("requestBody", {}).get("content", {}).get("application/json", {})
    name = content.get("schema", {}).get("$ref", "").rpartition("/")[2]
    return list(described["components"]["schemas"].get(name, {}).get("properties", ()))


def peak_bytes() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
