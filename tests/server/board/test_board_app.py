"""The board's own server: only for the teacher's machine, and no request crashes it."""

from __future__ import annotations

import json
import random
import re
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from robot.types import Action
from server.board.app import create_board_app
from server.board.transport import RobotAddress, ServerPlace, UnreachableError
from server.config import Config
from tests.server.virtual_server import WEB

from .classroom_world import ClassWorld, VirtualNetwork, in_class

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
    """The board's application in place of a robot's."""

    fault = "none"

    def __init__(self, app: Any, port: int, link: Any = None) -> None:
        self.app, self.port, self.link = app, port, link
        self._sockets: list[Any] = []


def test_no_request_crashes_the_board_and_other_sites_are_refused() -> None:
    async def scenario(world: ClassWorld) -> Counter[int]:
        await world.until_there(list(world.pupils.values()))
        config = Config(port=8080, web=WEB)
        app = create_board_app(config, world.board, world.clock, lesson="fair-data")
        network = VirtualNetwork({8080: _Served(app, 8080)}, random.Random(1))
        place = ServerPlace(RobotAddress("127.0.0.1", 8080), "")
        lesson = await network.request(place, "GET", "/api/lesson", {}, b"")
        assert lesson.json() == {"lesson": "fair-data"}
        seen: Counter[int] = Counter()
        for method, path in PATHS:
            for foreign in ({"host": "evil.example"}, {"origin": "http://evil.example"}):
                answer = await network.request(place, method, path, foreign, b"{}")
                assert answer.status in (403, 421), (method, path, foreign)
            for body in BODIES:
                answer = await network.request(place, method, path, {}, body)
                assert answer.status < 500 or answer.status in (502, 503), (path, body[:40])
                seen[answer.status] += 1
        return seen

    assert set(in_class(scenario, robots=2)) >= {200, 400, 404}


def test_an_invalid_message_ends_only_the_connection_of_its_page() -> None:
    async def scenario(world: ClassWorld) -> None:
        [pupil] = world.pupils.values()
        app = create_board_app(Config(port=8080, web=WEB), world.board, world.clock)
        network = VirtualNetwork({8080: _Served(app, 8080, pupil.link)}, random.Random(1))
        place = ServerPlace(RobotAddress("127.0.0.1", 8080), "")
        for words in WORDS:
            async with network.connect(place, "/ws/board", {}) as channel:
                await channel.send(words)
                with pytest.raises(UnreachableError):
                    while True:
                        await channel.recv()
                assert channel.socket.task.exception() is None, words

    in_class(scenario, robots=1)


def test_a_release_that_waits_for_a_connection_does_not_delay_a_stop() -> None:
    """A connection that is being closed accepts messages for more than a second."""

    async def scenario(world: ClassWorld) -> float:
        gone, *others = world.pupils.values()
        await world.until_there([gone, *others])
        await world.drive_all(others)

        async def hang(_: object) -> None:
            await world.clock.pause(10.0)

        world.link(gone).stop.channel.send = hang
        app = create_board_app(Config(port=8080, web=WEB), world.board, world.clock)
        network = VirtualNetwork({8080: _Served(app, 8080, gone.link)}, random.Random(1))
        place = ServerPlace(RobotAddress("127.0.0.1", 8080), "")
        async with network.connect(place, "/ws/board", {}) as page:
            stops = {link.number: link.stop.id for link in world.board.robots.values()}
            await page.send(json.dumps({"type": "release", "stops": stops}))
            await page.send('{"type": "stop"}')
            driven = [pupil.driver for pupil in others]
            return await world.until(
                lambda: all(driver.now is Action.STOP for driver in driven), 5.0, "they stand"
            )

    assert in_class(scenario) < 0.3


def test_every_address_and_word_is_in_the_reference() -> None:
    page = (Path(__file__).parents[3] / "docs/reference/board.md").read_text("utf-8")
    named = set(re.findall(r"[\w/{}.-]+", page))

    async def scenario(world: ClassWorld) -> None:
        app = create_board_app(Config(port=8080, web=WEB), world.board, world.clock)
        paths = {path for route in app.routes if (path := getattr(route, "path", ""))}
        assert len(paths) > 7
        assert paths - named == set()
        [robot] = world.board.describe()
        assert robot.keys() | world.board.strangers.describe().keys() <= named

    in_class(scenario, robots=1)
