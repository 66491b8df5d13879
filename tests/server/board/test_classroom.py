"""Who becomes a robot's teacher, and what its pupils may change afterwards."""

import json
import os
import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from robot.errors import ConfigurationError
from server.access.pairing import Pairing
from server.board.class_command import split
from server.board.class_key import ClassKey, endpoint, keep_class_key, new_nonce, read_class_key
from server.board.classroom import LOCKS, Classroom
from server.board.simulated_robot import SimulatedRobot
from server.identity import NAMES
from tests.kit.described import described_routes
from tests.kit.sizes import seeds

from .classroom_world import ClassWorld, Pupil, in_class_time

KEY, OTHER = ClassKey("a" * 40), ClassKey("b" * 40)
HERE, THERE = "192.168.1.5:8000", "192.168.1.6:8000"


def test_a_board_with_the_key_gets_a_session_and_knows_the_robot():
    room, mine = Classroom(KEY), new_nonce()
    nonce, proof = room.challenge(mine, HERE, 10.0)
    assert KEY.accepts(proof, "robot", mine, nonce, HERE)
    secret = room.admit(mine, nonce, KEY.prove("board", mine, nonce, HERE), HERE, 10.1)
    assert secret and room.knows(f"Bearer {secret}")
    assert not room.knows(secret) and not room.knows("Bearer ") and not room.knows("")


@pytest.mark.parametrize("seed", seeds(8, 40))
def test_only_a_fresh_proof_of_the_same_handshake_is_admitted(seed):
    """Change one part of a valid handshake; the seed selects the part."""
    dice = random.Random(seed)
    room, mine, now_s = Classroom(KEY), new_nonce(), dice.uniform(0, 1e6)
    nonce, robot_proof = room.challenge(mine, HERE, now_s)
    good = {"board": mine, "nonce": nonce, "at": HERE, "key": KEY, "who": "board", "late_s": 1.0}
    wrong = {
        "board": [new_nonce(), "", mine.upper() + "x", mine + "\n"],
        "nonce": [nonce[:-1], nonce.replace(".", "", 1), "", room.challenge(mine, HERE, 0)[0]],
        "at": [THERE],
        "key": [OTHER],
        "who": ["robot", ""],
        "late_s": [10.5, 1e5],
    }
    field = dice.choice(list(wrong))
    bad = {**good, field: dice.choice(wrong[field])}
    proof = bad["key"].prove(bad["who"], str(bad["board"]), str(bad["nonce"]), bad["at"])
    at_s = now_s + bad["late_s"]
    assert room.admit(bad["board"], bad["nonce"], proof, HERE, at_s) is None, field
    assert room.admit(mine, nonce, robot_proof, HERE, now_s) is None, "a reflected proof is invalid"
    whole = KEY.prove("board", mine, nonce, HERE)
    assert room.admit(mine, nonce, whole, HERE, now_s + 1)
    assert room.admit(mine, nonce, whole, HERE, now_s + 1) is None, "a proof works only once"


def test_endpoints_are_written_in_one_way():
    assert endpoint("::ffff:10.0.0.1", 80) == endpoint("10.0.0.1", 80)
    assert endpoint("FE80::1%eth0", 80) == endpoint("fe80::1", 80)


def test_a_key_is_made_once_and_is_readable_only_by_its_owner(tmp_path):
    file = tmp_path / "deep" / "class.key"
    assert keep_class_key(file) == keep_class_key(file)
    assert file.stat().st_mode & 0o077 == 0
    assert file.read_text().strip() not in repr(read_class_key(file))
    file.write_text("")  # as after a full disk or a power cut
    assert keep_class_key(file) == read_class_key(file)
    for text in ("", "short", "ä" * 40):
        file.write_text(text)
        with pytest.raises(ConfigurationError, match="class key"):
            read_class_key(file)


def test_a_simulated_robot_whose_folder_cannot_be_written_keeps_its_name_and_runs_unlogged(
    tmp_path,
):
    saved = SimulatedRobot(1, 8481, tmp_path / "01")
    saved.open_log()
    assert saved.unsaved_name == "" and saved.log == tmp_path / "01" / "log.txt"
    unwritable = tmp_path / "01" / "log.txt" / "02"  # a path below a file cannot be read
    robot = SimulatedRobot(2, 8482, unwritable)
    robot.open_log()
    assert robot.unsaved_name == NAMES[1] and robot.log == Path(os.devnull)


def test_locks_and_id_survive_a_restart_and_an_unknown_lock_is_refused(tmp_path):
    file = tmp_path / "class.json"
    first = Classroom(KEY, file)
    assert first.locks == frozenset()
    Classroom(KEY, file).lock(["models", "gallery"])
    assert json.loads(file.read_text())["locks"] == ["gallery", "models"]
    again, other = Classroom(KEY, file), Classroom(KEY, tmp_path / "other.json")
    assert again.id == first.id != other.id and again.run != first.run
    unknown: list[Sequence[str]] = [["doors"], ["models", ""], "models"]
    for names in unknown:
        with pytest.raises(ConfigurationError, match="settings"):
            Classroom(KEY, file).lock(names)
    assert Classroom(KEY, file).locks == {"models", "gallery"}


@pytest.mark.parametrize("kept", [b"", b"{", b"[]", b"\xff", b'{"locks": 3}'])
def test_if_the_file_of_locks_is_damaged_everything_is_locked(tmp_path, kept):
    (tmp_path / "class.json").write_bytes(kept)
    assert Classroom(KEY, tmp_path / "class.json").locks == set(LOCKS)


def test_a_saved_session_cannot_have_the_role_of_a_teacher(tmp_path):
    file = tmp_path / "paired.json"
    file.write_text('{"sessions": [{"sha256": "00", "role": "teacher"}]}')
    assert Pairing(10, file)._sessions == {}


class Asker:
    """Sends requests to one robot, as a phone, a stranger or the teacher."""

    def __init__(self, world: ClassWorld, pupil: Pupil) -> None:
        self._world, self._pupil = world, pupil
        self.phone = {"cookie": pupil._cookie}
        self.teacher = world.link(pupil)._session.headers

    async def status(self, method: str, path: str, headers: Any, body: Any = None) -> int:
        data = b"" if body is None else json.dumps(body).encode()
        return (await self._world.ask(self._pupil, method, path, headers, data)).status


@in_class_time(robots=1)
async def test_every_change_below_a_lock_is_refused_and_reading_is_not(world):
    """The addresses come from the application itself, so that a new route is included."""
    one, _ = await world.first()
    asker = Asker(world, one)
    routes = described_routes(one.app.openapi())
    found = [(route.method, route.at()) for route in routes if route.method != "GET"]
    assert {path.split("/")[2] for _, path in found} >= {"settings", "models", "gallery"}
    for name in LOCKS:
        locks = {"locks": [name]}
        assert await asker.status("PUT", "/api/class/locks", asker.teacher, locks) == 200
        for method, path in found:
            if any(path == p or path.startswith(p + "/") for p in LOCKS[name]):
                assert await asker.status(method, path, asker.phone, {}) == 423, path
                assert await asker.status(method, path, asker.teacher, {}) != 423, path
        assert await asker.status("GET", LOCKS[name][0], asker.phone) != 423
    assert await asker.status("POST", "/api/stop", asker.phone) == 200
    assert one.classroom is not None and one.classroom.locks == {"recordings"}


@in_class_time(robots=1)
async def test_only_the_teacher_locks_invites_and_looks(world):
    one, _ = await world.first()
    asker = Asker(world, one)
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


@in_class_time(robots=1, faults=lambda dice, i: "no class")
async def test_a_robot_in_no_class_has_no_teacher(world):
    asker = Asker(world, next(iter(world.pupils.values())))
    assert await asker.status("POST", "/api/class/hello", {}, {"nonce": "0" * 32}) == 404
    assert await asker.status("GET", "/api/class", asker.phone) == 403


@in_class_time(robots=1)
async def test_the_code_on_the_board_pairs_phone_after_phone(world):
    one, link = await world.first()
    asker = Asker(world, one)
    seen = set()
    for _ in range(30):
        address = link.page_address()
        token = address.rsplit("#", 1)[1]
        seen.add(token)
        assert await asker.status("POST", "/api/pair", {}, {"token": token}) == 200
        await world.clock.pause(3.6)
    assert len(seen) > 1, "the displayed code changes with time, and is always valid"


@in_class_time(robots=1)
async def test_the_code_on_paper_pairs_until_the_class_has_another_key(world):
    one, link = await world.first()
    asker = Asker(world, one)
    paper = str(link.page_address(printed=True)).rsplit("#", 1)[1]
    old = ClassKey("o" * 40).code
    for _ in range(3):
        assert await asker.status("POST", "/api/pair", {}, {"token": paper}) == 200
        assert await asker.status("POST", "/api/pair", {}, {"token": old}) == 403
        one.restart()
        await world.clock.pause(400.0)  # longer than the lifetime of any invitation


def test_a_class_has_simulated_robots_and_real_ones_but_not_too_many():
    assert split("10") == (10, "")
    assert split(" 2, ada.local:8000 ,1") == (3, "ada.local:8000")
    assert split("192.168.1.2,robot:80") == (0, "192.168.1.2,robot:80")
    assert split("robots.txt") == (0, "robots.txt")
    for text in ("", "0", ",", "61", "30,31,ada:8000"):
        with pytest.raises(ConfigurationError, match="--robots"):
            split(text)
