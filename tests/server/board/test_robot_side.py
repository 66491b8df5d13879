"""The rights that a robot of a class gives its teacher and refuses everybody else."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest

from robot.errors import ConfigurationError
from server.board.class_command import split
from server.board.class_key import ClassKey
from server.board.classroom import LOCKS
from server.board.transport import RobotAddress, ServerPlace

from .classroom_world import ClassWorld, Pupil, in_class


class _Asker:
    """Sends requests to one robot, as a phone, a stranger or the teacher."""

    def __init__(self, world: ClassWorld, pupil: Pupil) -> None:
        self._network = world.network
        self._place = ServerPlace(RobotAddress("127.0.0.1", pupil.port), "")
        self._host = f"127.0.0.1:{pupil.port}"
        self.phone = {"cookie": pupil._cookie}
        self.teacher = world.link(pupil)._session.headers

    async def status(
        self, method: str, path: str, headers: dict[str, str], body: Any = None
    ) -> int:
        data = b"" if body is None else json.dumps(body).encode()
        answer = await self._network.request(
            self._place, method, path, {"host": self._host, **headers}, data
        )
        return answer.status


def test_every_change_below_a_lock_is_refused_and_reading_is_not() -> None:
    """The addresses come from the application itself, so that a new route is included."""

    async def scenario(world: ClassWorld) -> None:
        one = next(iter(world.pupils.values()))
        await world.until_there([one])
        asker = _Asker(world, one)
        found = _changing(one)
        assert {path.split("/")[2] for _, path in found} >= {"settings", "models", "gallery"}
        for name in LOCKS:
            assert (
                await asker.status("PUT", "/api/class/locks", asker.teacher, {"locks": [name]})
                == 200
            )
            for method, path in found:
                is_locked = any(path == p or path.startswith(p + "/") for p in LOCKS[name])
                if is_locked:
                    assert await asker.status(method, path, asker.phone, {}) == 423, path
                    assert await asker.status(method, path, asker.teacher, {}) != 423, path
            assert await asker.status("GET", LOCKS[name][0], asker.phone) != 423
        assert await asker.status("POST", "/api/stop", asker.phone) == 200
        assert one.classroom is not None and one.classroom.locks == {"recordings"}

    in_class(scenario, robots=1)


def _changing(pupil: Pupil) -> list[tuple[str, str]]:
    paths = pupil.app.openapi()["paths"]
    return [
        (method.upper(), re.sub(r"\{\w+\}", "1", path))
        for path, methods in paths.items()
        for method in methods
        if method not in ("get", "head")
    ]


def test_only_the_teacher_locks_invites_and_looks() -> None:
    async def scenario(world: ClassWorld) -> None:
        one = next(iter(world.pupils.values()))
        await world.until_there([one])
        asker = _Asker(world, one)
        for headers, wanted in (
            (asker.phone, 403),
            ({}, 401),
            ({"authorization": "Bearer x"}, 401),
            ({"authorization": f"Bearer {'a' * 43}", **asker.phone}, 403),
            (asker.teacher, 200),
        ):
            assert await asker.status("GET", "/api/class", headers) == wanted
            assert await asker.status("POST", "/api/class/invitation", headers, {}) == wanted
            locking = await asker.status("PUT", "/api/class/locks", headers, {"locks": []})
            assert locking == wanted
        other_site = {**asker.teacher, "origin": "http://evil.example"}
        assert await asker.status("PUT", "/api/class/locks", other_site, {"locks": []}) == 403

    in_class(scenario, robots=1)


def test_a_robot_in_no_class_has_no_teacher() -> None:
    async def scenario(world: ClassWorld) -> None:
        one = next(iter(world.pupils.values()))
        asker = _Asker(world, one)
        assert await asker.status("POST", "/api/class/hello", {}, {"nonce": "0" * 32}) == 404
        assert await asker.status("GET", "/api/class", asker.phone) == 403

    in_class(scenario, robots=1, faults=lambda dice, i: "no class")


def test_the_code_on_the_board_pairs_phone_after_phone() -> None:
    async def scenario(world: ClassWorld) -> None:
        one = next(iter(world.pupils.values()))
        await world.until_there([one])
        link, asker = world.link(one), _Asker(world, one)
        seen = set()
        for _ in range(30):
            address = link.page_address()
            assert address is not None
            token = address.rsplit("#", 1)[1]
            seen.add(token)
            assert await asker.status("POST", "/api/pair", {}, {"token": token}) == 200
            await world.clock.pause(3.6)
        assert len(seen) > 1, "the code changes as time goes on, and the one shown is always good"

    in_class(scenario, robots=1)


def test_the_code_on_paper_pairs_until_the_class_has_another_key() -> None:
    async def scenario(world: ClassWorld) -> None:
        one = next(iter(world.pupils.values()))
        await world.until_there([one])
        link, asker = world.link(one), _Asker(world, one)
        paper = str(link.page_address(printed=True)).rsplit("#", 1)[1]
        old = ClassKey("o" * 40).code
        for _ in range(3):
            assert await asker.status("POST", "/api/pair", {}, {"token": paper}) == 200
            assert await asker.status("POST", "/api/pair", {}, {"token": old}) == 403
            one.restart()
            await world.clock.pause(400.0)  # longer than any invitation

    in_class(scenario, robots=1)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("10", (10, "")),
        (" 2, ada.local:8000 ,1", (3, "ada.local:8000")),
        ("192.168.1.2,robot:80", (0, "192.168.1.2,robot:80")),
        ("robots.txt", (0, "robots.txt")),
    ],
)
def test_a_class_has_simulated_robots_and_real_ones(text: str, wanted: tuple[int, str]) -> None:
    assert split(text) == wanted


@pytest.mark.parametrize("text", ["", "0", ",", "61", "30,31,ada:8000"])
def test_a_class_has_at_least_one_robot_and_not_too_many(text: str) -> None:
    with pytest.raises(ConfigurationError, match="--robots"):
        split(text)
