"""A robot keeps its device through drops, renames, twins and swaps: generated histories of hubs
and bricks, by the code that searches for them. test_usb_camera.py has cameras."""

from __future__ import annotations

import asyncio
import hmac
import json
import random
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest

from robot.bodies.ev3 import stock_driver
from robot.bodies.ev3.stock import lines
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

HISTORIES = size("TWINS", 240, 10_000)
"""Number of histories, of all kinds of devices together."""
REFUSED = ("match:", "unclear which brick", "are plugged in", "which robot")
"""Words of the error if it is unknown which device is meant."""


class Place:
    """Devices of one kind in range, each with its current name, and one robot's search."""

    names: ClassVar[tuple[str, ...]] = ("Pybricks Hub", "Pybricks Hub", "Anna", "")
    shown: Any
    """The device's name on the page."""

    def __init__(self, chance: random.Random, patch: pytest.MonkeyPatch) -> None:
        self.chance, self.patch, self.clock = chance, patch, VirtualClock()
        self.all = [f"00:16:53:00:00:{n:02x}" for n in range(chance.randint(2, 5))]
        there = [one for one in self.all if chance.random() < 0.7]
        self.there = {one: chance.choice(self.names) for one in there}
        self.wanted = chance.choice(("", "", "Anna", self.all[0]))
        self.begin()

    def begin(self) -> None:
        raise NotImplementedError

    async def take(self) -> str:
        """Search like the driver; return the device that obeys. Raises an error if none does."""
        raise NotImplementedError

    def happen(self) -> None:
        """Lose, add or rename a device, or swap the names of two."""
        chance, there, event = self.chance, self.there, self.chance.random()
        if event < 0.4 and there:
            there.pop(chance.choice(sorted(there)))
        elif event < 0.7:
            there[chance.choice(self.all)] = chance.choice(self.names)
        elif len(there) > 1:
            one, other = chance.sample(sorted(there), 2)
            there[one], there[other] = there[other], there[one]

    def shuffled(self) -> list[tuple[str, str]]:
        return self.chance.sample(sorted(self.there.items()), len(self.there))


class Hubs(Place):
    """Pybricks hubs, as `bleak` shows them: each advertises itself ten times a second."""

    def begin(self) -> None:
        self.same = SameDevice("hub", self.wanted)
        self.BleakScanner = SimpleNamespace(find_device_by_filter=self._find)

    async def _find(self, fits: Callable[[Any, Any], bool], timeout: float, **_: Any) -> Any:
        for _ in range(round(timeout / 0.5)):
            for address, name in self.shuffled():
                device = SimpleNamespace(address=address, name=name or None)
                if fits(device, SimpleNamespace(local_name=name or None, service_uuids=[SERVICE])):
                    return device
            self.clock.advance(0.5)
        return None

    async def take(self) -> str:
        hub, device = await find_hub(self, self.same, self.clock)
        assert device.address == hub.address
        self.same.chosen = self.same.chosen or hub
        return hub.address

    @property
    def shown(self) -> str:
        return str(self.same.chosen)


class WifiBricks(Place):
    """EV3 bricks with LEGO's firmware: each announces itself every 5 s, and is heard twice."""

    def begin(self) -> None:
        brick = self.wanted if ":" in self.wanted else ""
        self.driver = Ev3StockDriver(Ev3StockOptions(line="wifi", brick=brick), self.clock)
        self.patch.setattr(stock_driver, "open_line", self._open)

    def _heard(self) -> Iterator[tuple[float, Beacon | None]]:
        since_s = self.clock.now_s()
        phases = [(self.chance.uniform(0.0, 5.0), at.replace(":", "")) for at in self.there]
        heard = [(phase + delay, at) for phase, at in phases for delay in (0.0, 0.01, 5.0)]
        for at_s, brick in sorted(heard):
            if at_s < 8.0:
                yield since_s + at_s, Beacon("10.0.0.7", 3015, brick, 5555)

    def _open(self, kind: str, brick: str, *_: Any) -> Any:
        chosen = choose_brick(self._heard(), brick.replace(":", ""))
        if chosen is None:
            raise DriveError("it was not heard")
        return SimpleNamespace(serial=chosen.serial)

    async def take(self) -> str:
        return str(lines.shown_id(self.driver._open_line().serial))

    @property
    def shown(self) -> str:
        return self.driver.device


class CableBricks(WifiBricks):
    """The same on USB cables; their names are sockets, which identify nothing."""

    def _open(self, kind: str, brick: str, *_: Any) -> Any:
        there = {at.replace(":", ""): at for at, _ in self.shuffled()}
        self.patch.setattr(lines, "_usb_bricks", lambda root=None: there)
        path = lines.find_usb(brick.replace(":", ""))
        return SimpleNamespace(serial=str(path).replace(":", ""))


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


KINDS: tuple[type[Place], ...] = (Hubs, WifiBricks, CableBricks)


async def live(place: Place, seed: int) -> list[int]:
    """Run one history; return how often the device was found, refused and missing."""
    counts, mine = [0, 0, 0], ""
    for _ in range(12):
        try:
            taken = await place.take()
        except (ConnectionError, DriveError) as error:
            is_refused = any(words in str(error) for words in REFUSED)
            counts[1 if is_refused else 2] += 1
            assert not (is_refused and mine), f"it knows which one: {error}"
        else:
            counts[0] += 1
            mine = mine or taken
            assert taken == mine, f"another one in history {seed}"
            assert mine in place.shown, "the page says which one it is"
        place.happen()
    return counts


@pytest.mark.parametrize("kind", KINDS)
def test_no_history_of_drops_and_renames_leads_to_another_device(
    kind: type[Place], monkeypatch: pytest.MonkeyPatch
) -> None:
    n_lives = HISTORIES // len(KINDS) + 1

    async def live_all() -> list[list[int]]:
        return [await live(kind(random.Random(seed), monkeypatch), seed) for seed in range(n_lives)]

    found, refused, missing = map(sum, zip(*asyncio.run(live_all()), strict=True))
    assert min(found, refused, missing) > n_lives / 5


def test_twins_are_told_apart_and_a_lost_one_is_named() -> None:
    twins = [Found("Pybricks Hub", f"00:16:53:00:00:0{n}") for n in (2, 1)]
    same = SameDevice("hub")
    with pytest.raises(ConnectionError, match=r"2 hubs .*:02.*--hub 00:16:53:00:00:01"):
        same.pick(twins)
    assert SameDevice("hub", "00:16:53:00:00:02").pick(twins) is twins[0]
    assert SameDevice("hub", "Anna").pick(twins) is None
    same.chosen = twins[0]
    assert same.pick(twins[1:]) is None
    assert "another one is in range" in same.name_absent(twins[1:])
    assert same.pick([Found("renamed", twins[0].address), twins[1]]) is not None


def test_a_robot_in_the_place_of_another_is_named_and_never_driven() -> None:
    """Small robots take over each other's address, here all without a secret."""
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
    assert ben.asked <= 1, "only what was on its way"
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
