"""The board's own server: only for the teacher's machine, and no request crashes it."""

from __future__ import annotations

import contextlib
import json
import random
import re
from pathlib import Path
from typing import Any

import pytest

from server.board.app import create_board_app
from server.board.transport import HttpAnswer, RobotAddress, ServerPlace, UnreachableError
from server.config import Config
from tests.server.virtual_server import WEB

from .classroom_world import ClassWorld, VirtualNetwork, in_class_time

PATHS = (
    ("POST", "/api/stop"),
    ("PUT", "/api/robots/1"),
    ("PUT", "/api/robots/99"),
    ("POST", "/api/robots/1/copy-model"),
    ("GET", "/api/robots/1/qr.svg"),
    ("GET", "/api/robots/x/qr.svg"),
)
BODIES = (
    *(b"", b"{", b"[]", b'{"robot": 1}', b'{"robot": [1]}', b'{"robot": "x"}', b'{"robot": -1}'),
    *(
        b'{"locks": 3}',
        b'{"locks": ["models"]}',
        b'{"name": 3}',
        b'{"to": [1, 99]}',
        b'{"to": [2]}',
    ),
    *(b'{"to": [{}]}', b"\xff\xfe", b"[" * 5000),
)


WORDS = (
    *("", "{", "[]", "3", "[" * 5000, '{"type": "dance"}', '{"type": "stop", "robot": 99}'),
    *('{"type": "watch"}', '{"type": "watch", "robots": ["x"]}', '{"type": "watch", "robots": 1}'),
    '{"type": "watch", "robots": [1e999]}',
    *('{"type": "release"}', '{"type": "release", "stops": [1]}'),
    *('{"type": "release", "stops": {"x": "a"}}', '{"type": "release", "stops": {"99": "a"}}'),
)


class _Served:
    """The board's application in place of a robot's, and the way to it."""

    fault = "none"

    def __init__(self, world: ClassWorld) -> None:
        self.app = create_board_app(
            Config(port=8080, web=WEB), world.board, world.clock, lesson="fair-data"
        )
        self.port, self.link = 8080, next(iter(world.pupils.values())).link
        self._sockets: list[Any] = []
        self._network = VirtualNetwork({self.port: self}, random.Random(1))
        self._place = ServerPlace(RobotAddress("127.0.0.1", self.port), "")

    async def ask(
        self, method: str, path: str, headers: dict[str, str], body: bytes = b""
    ) -> HttpAnswer:
        return await self._network.request(self._place, method, path, headers, body)

    def page(self) -> contextlib.AbstractAsyncContextManager[Any]:
        return self._network.connect(self._place, "/ws/board", {})


@in_class_time(robots=2)
async def test_no_request_crashes_the_board_and_other_sites_are_refused(world: ClassWorld) -> None:
    await world.until_there()
    board = _Served(world)
    assert (await board.ask("GET", "/api/lesson", {})).json() == {"lesson": "fair-data"}
    seen = set()
    for method, path in PATHS:
        for foreign in ({"host": "evil.example"}, {"origin": "http://evil.example"}):
            answer = await board.ask(method, path, foreign, b"{}")
            assert answer.status in (403, 421), (method, path, foreign)
        for body in BODIES:
            answer = await board.ask(method, path, {}, body)
            assert answer.status < 500 or answer.status in (502, 503), (path, body[:40])
            seen.add(answer.status)
    assert seen >= {200, 400, 404}


@in_class_time(robots=1)
async def test_an_invalid_message_ends_only_the_connection_of_its_page(world: ClassWorld) -> None:
    board = _Served(world)
    for words in WORDS:
        async with board.page() as channel:
            await channel.send(words)
            with pytest.raises(UnreachableError):
                while True:
                    await channel.recv()
            assert channel.socket.task.exception() is None, words


@in_class_time()
async def test_a_release_that_waits_for_a_connection_does_not_delay_a_stop(
    world: ClassWorld,
) -> None:
    """A connection that is being closed accepts messages for more than a second."""
    _, hanging = await world.first()
    others = list(world.pupils.values())[1:]
    await world.drive_all(others)

    async def hang(_: object) -> None:
        await world.clock.pause(10.0)

    hanging.stop.channel.send = hang
    async with _Served(world).page() as page:
        stops = {link.number: link.stop.id for link in world.board.robots.values()}
        await page.send(json.dumps({"type": "release", "stops": stops}))
        await page.send('{"type": "stop"}')
        took_s = await world.until(
            lambda: all(pupil.stands() for pupil in others), 5.0, "they stand"
        )
    assert took_s < 0.3


@in_class_time(robots=1)
async def test_every_address_and_word_is_in_the_reference(world: ClassWorld) -> None:
    page = (Path(__file__).parents[3] / "docs/reference/board.md").read_text("utf-8")
    named = set(re.findall(r"[\w/{}.-]+", page))
    paths = {path for route in _Served(world).app.routes if (path := getattr(route, "path", ""))}
    assert len(paths) > 7
    assert paths - named == set()
    [robot] = world.board.describe()
    assert robot.keys() | world.board.strangers.describe().keys() <= named
