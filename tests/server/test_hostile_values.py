"""Every described route answers invalid values by a 4xx with a sentence, never by a 5xx.

test_fuzz.py tests memory, and malformed models.
"""

import json
import re
from pathlib import Path
from typing import Any
from urllib.parse import quote

import httpx
import pytest

from robot import __version__
from robot.store.folder import Storage
from server.access.config import NetworkLimits
from server.config import Config
from tests.kit.described import Described, described_routes
from tests.kit.sizes import IS_FULL, few
from tests.robot.recordings.drives import record_drive

from .virtual_server import WEB, VirtualServer

REFUSED = (
    '"\\ud83d"', '"Kitchen \\ud83d"', '"' + "x" * 10_000 + '"', "NaN", "1e400", "9" * 5_000,
    '"../../x"',
)  # fmt: skip
"""Values that nearly every field must refuse."""
OTHERS = (
    "Infinity", "-1", "null", "true", "[]", "{}", '[["x"]]', '""', '"default-999999"',
    '"\\u0000"', "-0", '"CON"', '"\\u202e"',
)  # fmt: skip
WHOLE = (b"", b"[]", b"null", b"{", b"\xff\xfe", b"[" * 50_000, b'"x"', b"1e999")
NAMES = (
    *("%ED%A0%BD", "%FF%FE", "%2e%2e", "%00", "..%2f..%2fetc", "9" * 400, "nan", "-1"),
    *(quote(name, safe="") for name in ("\ufffd", "x" * 3_000, "CON", "%", " ", "\U0001f600")),
)
QUERIES = ("nan", "inf", "-1", "1e999", "x", "9" * 400)
EDIT = {"verb": "relabel", "first": 1, "last": 2, "label": "left"}
_ACCEPTED = {"place", "title"}
"""Fields of free text."""


class Robot:
    """A robot with a model and a recording, and every route that its server describes."""

    def __init__(self, client: httpx.Client, episode: str) -> None:
        self.client, self.episode = client, episode
        spec = client.get("/openapi.json").json()
        left_out = ("/api/stop", "/video.mjpg")
        self.routes = [one for one in described_routes(spec) if one.path not in left_out]

    def existing(self, path: str) -> str:
        """Return the path with the names of existing items."""
        model = self.client.get("/api/models").json()["current"]
        known = {"episode_id": self.episode, "name": quote(model, safe="")}
        return re.sub(r"{(\w+)}", lambda found: known.get(found[1], "1"), path)

    def ask(self, method: str, path: str, body: bytes = b"", kind: str = "") -> httpx.Response:
        headers = {"content-type": kind} if kind else {}
        return self.client.request(method, path, content=body, headers=headers)


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    root: Path = tmp_path_factory.mktemp("hostile")
    episode = record_drive(Storage(root).folder("episodes"), frames=20).id
    limits = NetworkLimits(requests_per_second=1e6, requests_burst=1e6, pairing_failures=10**6)
    with (
        VirtualServer(Config(port=0, web=WEB, data=root, limits=limits), data=root) as server,
        httpx.Client(base_url=server.address, timeout=60) as client,
    ):
        client.post("/api/models/save")
        yield Robot(client, episode)


def body_of(route: Described, field: str, value: str) -> bytes:
    rest: dict[str, Any] = EDIT if route.path.endswith("/edits") else {}
    inner = [f'"{key}": {json.dumps(own)}' for key, own in rest.items() if key != field]
    return ("{" + ", ".join([*inner, f'"{field}": {value}']) + "}").encode()


def test_a_hostile_value_is_refused_in_every_field_and_nothing_breaks(robot):
    unlike = []
    fields = [(route, field) for route in robot.routes for field in route.fields]
    assert len(fields) > 40
    for number, (route, field) in enumerate(fields):
        refused = few(REFUSED[number % 3 :], 3)
        others = few(OTHERS[number % 3 :], 2)
        if IS_FULL:
            refused, others = REFUSED, OTHERS
        path = robot.existing(route.path)
        for value in (*refused, *others):
            answer = robot.ask(route.method, path, body_of(route, field, value))
            is_refused = 400 <= answer.status_code < 500 and answer.json()["detail"]
            may_pass = value in others or field in _ACCEPTED
            if not is_refused and (answer.status_code not in (200, 201, 501, 503) or not may_pass):
                unlike.append((route.method, route.path, field, value[:40], answer.status_code))
    assert unlike == []
    assert robot.client.post("/api/models/save").status_code == 200
    assert robot.client.get("/api/episodes").status_code == 200


def test_a_hostile_name_is_refused_in_every_path(robot):
    unlike = []
    for route in robot.routes:
        first, _, rest = route.path.rpartition("{")
        known, rest = robot.existing(first), rest.partition("}")[2]
        for name in NAMES if "{" in route.path else ():
            for path in {route.at(name), known + name + rest}:
                answer = robot.ask(route.method, path)
                if not 400 <= answer.status_code < 500:
                    unlike.append((route.method, path[:60], answer.status_code))
    assert unlike == []


def test_no_hostile_query_or_body_makes_a_route_fail(robot):
    failures = []
    for route in robot.routes:
        path = robot.existing(route.path)
        asked = [(f"{path}?{name}={value}", b"") for name in route.query for value in QUERIES]
        if route.method not in ("GET", "DELETE"):
            asked += [(path, body) for body in few(WHOLE, 4)]
        for address, body in asked:
            answer = robot.ask(route.method, address, body)
            if answer.status_code >= 500 and answer.status_code != 503:
                failures.append((route.method, address[:60], body[:20], answer.status_code))
    assert failures == []


@pytest.mark.parametrize("kind", ["application/x-www-form-urlencoded", "text/plain"])
def test_a_request_that_does_not_declare_its_json_gets_advice(robot, kind):
    """Send the body like `curl -d`, as a form."""
    routes = [route for route in robot.routes if route.fields]
    answers = [robot.ask(route.method, route.at(), b"{}", kind) for route in routes]
    assert [answer for answer in answers if answer.is_success] == []
    told = [answer.json()["detail"] for answer in answers if answer.status_code == 400]
    assert len(told) > 15
    assert {sentence for sentence in told if "Content-Type" not in sentence} == set()


def test_a_request_with_invalid_json_fields_is_told_what_is_wrong(robot):
    for value, wanted in (([1], "a JSON object"), ({"seconds": 99}, "'seconds' must be")):
        answer = robot.client.post("/api/teaching/undo", json=value)
        assert (answer.status_code, wanted in answer.json()["detail"]) == (400, True), answer.text


def test_the_openapi_description_names_this_version(robot):
    assert robot.client.get("/openapi.json").json()["info"]["version"] == __version__
