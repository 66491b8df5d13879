"""A driver keeps its device, although connections drop and other devices have its name or address.

tests/robot/devkit/test_cameras.py tests cameras."""

from __future__ import annotations

import asyncio
import hmac
import json
import random
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from robot.bodies.ev3 import stock_driver
from robot.bodies.ev3.stock.lines import Beacon, choose_brick
from robot.bodies.ev3.stock_driver import Ev3StockDriver, Ev3StockOptions
from robot.bodies.pybricks.hub_line import SERVICE, find_hub
from robot.bodies.remote.driver import RemoteOptions, the_only_one
from robot.bodies.remote.same_device import Found, SameDevice
from robot.bodies.remote.udp import UdpDriver
from robot.errors import DriveError
from robot.testing import VirtualClock
from robot.types import Action
from tests.kit.sizes import size

HISTORIES = size("TWINS", 80, 5000)


class Hubs:
    """The Pybricks hubs in range, each with its current name, like `bleak`."""

    names = ("Pybricks Hub", "Pybricks Hub", "Anna", "")

    def __init__(self, chance: random.Random) -> None:
        self.chance, self.clock = chance, VirtualClock()
        self.all = [f"00:16:53:00:00:{n:02x}" for n in range(chance.randint(2, 5))]
        self.there = {one: chance.choice(self.names) for one in self.all if chance.random() < 0.7}
        self.BleakScanner = SimpleNamespace(find_device_by_filter=self._find)

    async def _find(self, fits: Callable[[Any, Any], bool], timeout: float, **_: Any) -> Any:
        for _ in range(round(timeout / 0.5)):
            for address, name in self.chance.sample(sorted(self.there.items()), len(self.there)):
                device = SimpleNamespace(address=address, name=name or None)
                if fits(device, SimpleNamespace(local_name=name or None, service_uuids=[SERVICE])):
                    return device
            self.clock.advance(0.5)
        return None

    def happen(self) -> None:
        """Lose, add or rename a hub, or swap the names of two hubs."""
        chance, there, event = self.chance, self.there, self.chance.random()
        if event < 0.4 and there:
            there.pop(chance.choice(sorted(there)))
        elif event < 0.7:
            there[chance.choice(self.all)] = chance.choice(self.names)
        elif len(there) > 1:
            one, other = chance.sample(sorted(there), 2)
            there[one], there[other] = there[other], there[one]


def test_no_history_of_drops_and_renames_leads_to_another_hub() -> None:
    n_found = n_refused = 0
    for seed in range(HISTORIES):
        hubs = Hubs(random.Random(seed))
        same = SameDevice("hub", hubs.chance.choice(("", "", "Anna", hubs.all[0])))
        for _ in range(12):
            try:
                hub, device = asyncio.run(find_hub(hubs, same, hubs.clock))
            except ConnectionError as error:
                n_refused += (is_refused := "match:" in str(error))
                assert not (is_refused and same.chosen), f"the driver knows its device: {error}"
            else:
                n_found += 1
                same.chosen = same.chosen or hub
                assert hub.address == device.address == same.chosen.address, f"history {seed}"
            hubs.happen()
    assert min(n_found, n_refused) > HISTORIES / 5


A, B = "001653000001", "001653000002"


@pytest.mark.parametrize(
    ("heard", "wanted", "chosen"),
    [
        ([(0.0, A), (0.01, A), (5.0, A)], "", A),
        ([(0.0, A), (2.0, B)], B, B),
        ([(0.0, B), (8.0, "")], A, None),
        ([(8.0, "")], "", None),
    ],
    ids=["the only one, heard twice", "the wanted one", "only another one", "none"],
)
def test_a_brick_is_chosen_by_its_announcements(
    heard: list[tuple[float, str]], wanted: str, chosen: str | None
) -> None:
    beacons = [(at_s, Beacon("10.0.0.7", 3015, it, 5555) if it else None) for at_s, it in heard]
    found = choose_brick(beacons, wanted)
    assert (found and found.serial) == chosen


def test_of_two_bricks_that_announce_themselves_none_is_chosen() -> None:
    beacons = [
        (at_s, Beacon("10.0.0.7", 3015, it, 5555)) for at_s, it in ((0, A), (0.01, A), (4.9, B))
    ]
    with pytest.raises(DriveError, match=r"unclear which brick.*--brick 00:16:53:00:00:01"):
        choose_brick(beacons)


def test_a_driver_asks_for_the_brick_that_it_had_first(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def open_line(kind: str, brick: str, *_: Any) -> Any:
        asked.append(brick)
        return SimpleNamespace(serial=A)

    monkeypatch.setattr(stock_driver, "open_line", open_line)
    driver = Ev3StockDriver(Ev3StockOptions(line="wifi"), VirtualClock())
    for _ in range(2):
        driver._open_line()
    assert (asked, driver.device) == (["", A], "00:16:53:00:00:01")


class Board:
    """A robot of the one-page protocol."""

    def __init__(self, name: str, clock: VirtualClock) -> None:
        self.name, self.clock, self.moves, self.asked, self.seq = name, clock, 0, 0, 0

    def answer(self, message: bytes) -> bytes:
        text, _, mac = message.partition(b"\t")
        order = json.loads(text)
        self.asked += "move" in order
        own = hmac.new(b"", self.name.encode() + text, "sha256").hexdigest()[:16].encode()
        if mac == own and order["seq"] > self.seq:
            self.seq = order["seq"]
            self.moves += order["move"] == "forward"
        ms = round(1000 * self.clock.now_s())
        report = {"nonce": self.name, "seq": self.seq, "ms": ms, "id": self.name}
        return json.dumps(report).encode()


def test_twins_are_told_apart_and_a_lost_one_is_named() -> None:
    twins = [Found("Pybricks Hub", f"00:16:53:00:00:0{n}") for n in (2, 1)]
    same = SameDevice("hub")
    with pytest.raises(ConnectionError, match=r"2 hubs .*:02.*--hub 00:16:53:00:00:01"):
        same.pick(twins)
    assert SameDevice("hub", "00:16:53:00:00:02").pick(twins) is twins[0]
    assert SameDevice("hub", "Anna").pick(twins) is None
    same.chosen = twins[0]
    assert same.pick(twins[1:]) is None
    assert "another hub is in range" in same.name_absent(twins[1:])
    assert same.pick([Found("renamed", twins[0].address), twins[1]]) is not None


def test_a_robot_in_the_place_of_another_is_named_and_never_driven() -> None:
    """Robots without a secret may get each other's address."""
    clock = VirtualClock()
    anna, ben = (Board(name, clock) for name in ("Anna", "Ben"))
    there, waiting = [anna], list[bytes]()
    line: Any = SimpleNamespace(
        send=lambda message: waiting.append(there[0].answer(message)),
        receive=lambda timeout_s: waiting.pop() if waiting else clock.advance(timeout_s),
        close=lambda: None,
    )
    driver = UdpDriver(RemoteOptions(address="10.0.0.7"), clock)
    driver._open_line = lambda: line
    driver.connect()
    driver.send_action(Action.FORWARD)
    assert (driver.device, anna.moves) == ("Anna", 1)
    there[0] = ben
    for _ in range(20):
        clock.advance(1.0)
        with pytest.raises(DriveError, match="'Ben' answers there now, not 'Anna'"):
            driver.send_action(Action.FORWARD)
        with pytest.raises(DriveError, match="'Ben' answers there now, not 'Anna'"):
            driver.sense()
    assert (driver.device, ben.moves) == ("Anna", 0)
    assert ben.asked <= 1, "the other robot got only messages that were already in transit"
    there[0] = anna
    clock.advance(1.0)
    driver.sense()
    driver.send_action(Action.FORWARD)
    assert anna.moves == 2


def test_a_name_that_two_machines_have_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    places = [("10.0.0.7", 0), ("10.0.0.5", 0)]
    found = [(2, 2, 17, "", place) for place in places]
    monkeypatch.setattr("robot.bodies.remote.driver.socket.getaddrinfo", lambda *_: found)
    with pytest.raises(DriveError, match=r"10.0.0.5, 10.0.0.7; .*--address 10.0.0.5"):
        the_only_one("robot.local")
    assert the_only_one("10.0.0.9") == "10.0.0.9"
    del found[0]
    assert the_only_one("Robot.LOCAL") == "10.0.0.5"
