"""The board's own server serves only the teacher's machine, and no request crashes it."""

import contextlib
import json
import random
import re
from pathlib import Path
from typing import Any

import pytest

from server.board.app import create_board_app
from server.board.transport import RobotAddress, ServerPlace, UnreachableError
from server.config import Config
from tests.server.virtual_server import WEB

from .classroom_world import ClassWorld, VirtualNetwork, in_class_time

PATHS = (
    *(("POST", "/api/stop"), ("PUT", "/api/robots/1"), ("PUT", "/api/robots/99")),
    *(("POST", "/api/robots/1/copy-model"), ("GET", "/api/robots/1/qr.svg")),
    ("GET", "/api/robots/x/qr.svg"),
)
BODIES = (
    *(b"", b"{", b"[]", b'{"robot": 1}', b'{"robot": [1]}', b'{"robot": -1}', b'{"locks": 3}'),
    *(
        b'{"locks": ["models"]}',
        b'{"name": 3}',
        b'{"to": [1, 99]}',
        b'{"to": [2]}',
        b'{"to": [{}]}',
    ),
    *(b"\xff\xfe", b"[" * 5000),
)
WORDS = (
    *("", "{", "[]", "3", "[" * 5000, '{"type": "dance"}', '{"type": "stop", "robot": 99}'),
    *('{"type": "watch"}', '{"type": "watch", "robots": ["x"]}', '{"type": "watch", "robots": 1}'),
    *('{"type": "watch", "robots": [1e999]}', '{"type": "release", "stops": [1]}'),
    *('{"type": "release", "stops": {"x": "a"}}', '{"type": "release", "stops": {"99": "a"}}'),
)


class Served:
    """The board's application, which is served like a robot's."""

    def __init__(self, world: ClassWorld) -> None:
        config = Config(port=8080, web=WEB)
        self.app = create_board_app(config, world.board, world.clock, lesson="fair-data")
        self.port, self.fault, self._sockets = 8080, "none", list[Any]()
        self.link = next(iter(world.pupils.values())).link

    def page(self) -> contextlib.AbstractAsyncContextManager[Any]:
        network = VirtualNetwork({self.port: self}, random.Random(1))
        return network.connect(
            ServerPlace(RobotAddress("127.0.0.1", self.port), ""), "/ws/board", {}
        )


@in_class_time(robots=2)
async def test_no_request_crashes_the_board_and_other_sites_are_refused(world):
    await world.until_there()
    board = Served(world)
    assert (await world.ask(board, "GET", "/api/lesson", {})).json() == {"lesson": "fair-data"}
    seen = set()
    for method, path in PATHS:
        for foreign in ({"host": "evil.example"}, {"origin": "http://evil.example"}):
            answer = await world.ask(board, method, path, foreign, b"{}")
            assert answer.status in (403, 421), (method, path, foreign)
        for body in BODIES:
            answer = await world.ask(board, method, path, {}, body)
            assert answer.status < 500 or answer.status in (502, 503), (path, body[:40])
            seen.add(answer.status)
    assert seen >= {200, 400, 404}


@in_class_time(robots=1)
async def test_an_invalid_message_ends_only_the_connection_of_its_page(world):
    board = Served(world)
    for words in WORDS:
        async with board.page() as channel:
            await channel.send(words)
            with pytest.raises(UnreachableError):
                while True:
                    await channel.recv()
            assert channel.socket.task.exception() is None, words


@in_class_time()
async def test_a_release_that_waits_for_a_connection_does_not_delay_a_stop(world):
    """A connection that is being closed accepts messages for more than a second."""
    _, hanging = await world.first()
    others = list(world.pupils.values())[1:]
    await world.drive_all(others)

    async def hang(_):
        await world.clock.pause(10.0)

    hanging.stop.channel.send = hang
    async with Served(world).page() as page:
        stops = {link.number: link.stop.id for link in world.board.robots.values()}
        await page.send(json.dumps({"type": "release", "stops": stops}))
        await page.send('{"type": "stop"}')
        took_s = await world.until(lambda: all(pupil.stands() for pupil in others), 5.0)
    assert took_s < 0.3


@in_class_time(robots=1)
async def test_every_address_and_word_is_in_the_reference(world):
    page = (Path(__file__).parents[3] / "docs/reference/board.md").read_text("utf-8")
    named = set(re.findall(r"[\w/{}.-]+", page))
    paths = {path for route in Served(world).app.routes if (path := getattr(route, "path", ""))}
    assert len(paths) > 7
    assert paths - named == set()
    [robot] = world.board.describe()
    assert robot.keys() | world.board.strangers.describe().keys() <= named
