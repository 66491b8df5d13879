"""Whatever the network announces, the class's robots are on the board, and STOP reaches them."""

import asyncio
import random
from typing import Any

import pytest

from server.board.discovery import read_announcement
from server.board.teacher_session import Status
from server.board.transport import RobotAddress

from .classroom_world import STOP_S, Absent, ClassWorld, in_class_time, latched

FOREIGN, OWN = 1000, 10
_DOES = ("gone", "silent", "refuses", "nonsense")


def announce(world: ClassWorld, foreign: int, host: str = "127.0.0.1") -> list[RobotAddress]:
    """Have strangers announce this many robots before, between and after those of the class."""
    ports = range(20_000, 20_000 + foreign)
    strangers = {port: Absent(port, world.dice.choice(_DOES)) for port in ports}
    world.network.pupils = {**world.pupils, **strangers}
    said = [RobotAddress(host, port) for port in ports]
    said += [RobotAddress("127.0.0.1", port) for port in world.pupils]
    world.dice.shuffle(said)
    for address in said:
        world.board.announce(address)
    return said


@pytest.mark.parametrize("host", ["127.0.0.1", "10.0.0.66"])
@in_class_time(robots=OWN, is_told=False)
async def test_a_thousand_foreign_announcements_do_not_keep_the_robots_of_the_class_away(
    world, host
):
    announce(world, FOREIGN, host)
    pupils = list(world.pupils.values())

    def all_there():
        ours = world.board.robots.values()
        return len(ours) == OWN and all(one.status is Status.THERE for one in ours)

    came_s = await world.until(all_there, 300.0, "all robots of the class are there")
    assert host == "127.0.0.1" or came_s < 10.0, "strangers on one host delay no other host"
    assert {one.address.port for one in world.board.robots.values()} == set(world.pupils)
    await world.drive_all(pupils)
    announce(world, FOREIGN, host)
    world.board.stop()
    took_s = await world.until(lambda: all(map(latched, pupils)), 5.0, "all robots stand")
    assert took_s < STOP_S
    told = world.board.strangers.describe()
    assert told["count"] == FOREIGN and 0 < len(told["some"]) < 100


@in_class_time(robots=1, is_told=False)
async def test_a_silent_robot_is_forgotten_and_one_that_proves_the_key_later_joins(world):
    one = next(iter(world.pupils.values()))
    one.fault = "gone"
    announce(world, 5)
    await world.clock.pause(10.0)
    assert world.board.strangers.describe()["count"] == 5 + len(world.pupils)
    one.fault = "none"
    for _ in range(4):
        await world.clock.pause(60.0)
        world.board.announce(RobotAddress("127.0.0.1", one.port))
    await world.clock.pause(1.0)
    assert [robot.address.port for robot in world.board.robots.values()].count(one.port) == 1
    assert world.board.strangers.describe() == {"count": 0, "some": []}


@in_class_time(robots=1, is_told=False)
async def test_a_robot_that_is_announced_before_it_serves_joins_without_a_new_announcement(world):
    one = next(iter(world.pupils.values()))
    one.fault = "refuses"
    world.board.announce(RobotAddress("127.0.0.1", one.port))
    await world.clock.pause(5.0)
    one.fault = "none"
    await world.until(lambda: world.board.robots, 5.0, "the robot has joined")


def test_a_robot_is_queried_only_at_the_sender_of_its_announcement():
    zeroconf = pytest.importorskip("zeroconf")

    def packet(said, port=8123, kind="_http._tcp.local."):
        properties = {"path": "/", "drivelesson": "Ada", "address": said}
        info: Any = zeroconf.ServiceInfo(
            kind, f"Drivelesson x.{kind}", port=port, properties=properties, server="x.local.",
            addresses=[bytes([10, 0, 0, 7])],
        )  # fmt: skip
        out = zeroconf.DNSOutgoing(0x8400)
        for record in (info.dns_pointer(), info.dns_service(), info.dns_text()):
            out.add_answer_at_time(record, 0)
        return bytes(out.packets()[0])

    here = RobotAddress("10.0.0.7", 8123)
    assert read_announcement(packet("10.0.0.7"), "10.0.0.7") == [here]
    assert read_announcement(packet(""), "10.0.0.7") == [here]
    secure = packet("10.0.0.7", kind="_https._tcp.local.")
    assert read_announcement(secure, "10.0.0.7") == [RobotAddress("10.0.0.7", 8123, is_tls=True)]
    for elsewhere in ("10.0.0.8", "127.0.0.1", "localhost", "10.0.0.7:22"):
        assert read_announcement(packet(elsewhere), "10.0.0.7") == []
    assert read_announcement(packet("10.0.0.7", kind="_ipp._tcp.local."), "10.0.0.7") == []
    dice, whole = random.Random(1), packet("10.0.0.7")
    for _ in range(2000):
        data = bytearray(whole)
        for _ in range(dice.randrange(1, 4)):
            data[dice.randrange(len(data))] = dice.randrange(256)
        for found in read_announcement(bytes(data[: dice.randrange(len(data) + 1)]), "10.0.0.7"):
            assert found.host == "10.0.0.7"


@in_class_time(robots=1, is_told=False)
async def test_a_robot_whose_name_is_never_resolved_is_shown_with_a_reason(world, monkeypatch):
    async def locate(address):
        await asyncio.Event().wait()

    monkeypatch.setattr(world.network, "locate", locate)
    world.board.announce(RobotAddress("lost.local", 8000))
    await world.clock.pause(10.0)
    world.board.stop()
    assert world.board.at_leisure.is_set(), "no robot of the class has to stop"
    [lost] = world.board.strangers.describe()["some"]
    assert (lost["status"], lost["detail"]) == ("away", "the robot does not answer in time")


@in_class_time(robots=1)
async def test_what_a_robot_changes_while_the_board_connects_is_shown(world, monkeypatch):
    pupil, connect = next(iter(world.pupils.values())), world.network.connect

    def connect_late(*where):
        pupil.services.identity.change(name="Ida")
        return connect(*where)

    monkeypatch.setattr(world.network, "connect", connect_late)
    await world.until_there()
    await world.clock.pause(1.0)
    assert world.link(pupil).name == "Ida"
