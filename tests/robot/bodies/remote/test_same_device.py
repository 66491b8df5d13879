"""A driver keeps its device through drops, renames, twins and swaps; generated histories."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from robot.bodies.pybricks.hub_line import SERVICE, find_hub
from robot.bodies.remote.same_device import Found, SameDevice
from robot.testing import VirtualClock
from tests.kit.sizes import size

HISTORIES = size("TWINS", 200, 10_000)
_NAMES = ("Pybricks Hub", "Pybricks Hub", "Anna", "")


class Hubs:
    """Hubs in reach, as `bleak` shows them: each advertises itself ten times a second."""

    def __init__(self, clock: VirtualClock, chance: random.Random) -> None:
        self._clock, self._chance = clock, chance
        self.hubs: dict[str, str] = {}
        self.BleakScanner = SimpleNamespace(find_device_by_filter=self._find)

    async def _find(self, fits: Callable[[Any, Any], bool], timeout: float, **_: Any) -> Any:
        for _ in range(round(timeout / 0.5)):
            for address, name in self._chance.sample(sorted(self.hubs.items()), len(self.hubs)):
                device = SimpleNamespace(address=address, name=name or None)
                if fits(device, SimpleNamespace(local_name=name or None, service_uuids=[SERVICE])):
                    return device
            self._clock.advance(0.5)
        return None


async def live(seed: int) -> tuple[int, int, int]:
    """Live through one history; returns how often a hub was found, refused and missing."""
    chance, clock = random.Random(seed), VirtualClock()
    place = Hubs(clock, chance)
    addresses = [f"00:16:53:00:00:{n:02x}" for n in range(chance.randint(2, 5))]
    place.hubs = {one: chance.choice(_NAMES) for one in addresses if chance.random() < 0.7}
    same = SameDevice("hub", chance.choice(("", "", "Anna", addresses[0])))
    shown: Found | None = None
    counts = [0, 0, 0]
    for _ in range(12):
        try:
            hub, device = await find_hub(place, same, clock)
        except ConnectionError as error:
            counts[1 if "fit:" in str(error) else 2] += 1
            assert (shown is None) or shown.address not in place.hubs, "it is there, and not taken"
        else:
            counts[0] += 1
            assert device.address == hub.address
            assert shown is None or hub.address == shown.address, f"another hub in history {seed}"
            shown = same.chosen = same.chosen or hub
        event = chance.random()
        if event < 0.4 and place.hubs:
            place.hubs.pop(chance.choice(sorted(place.hubs)))
        elif event < 0.7:
            place.hubs[chance.choice(addresses)] = chance.choice(_NAMES)
        elif len(place.hubs) > 1:  # two swap their names
            one, other = chance.sample(sorted(place.hubs), 2)
            place.hubs[one], place.hubs[other] = place.hubs[other], place.hubs[one]
    return counts[0], counts[1], counts[2]


def test_no_history_leads_to_another_hub() -> None:
    async def live_all() -> list[tuple[int, int, int]]:
        return [await live(seed) for seed in range(HISTORIES)]

    found, refused, missing = map(sum, zip(*asyncio.run(live_all()), strict=True))
    assert min(found, refused, missing) > HISTORIES / 5


def test_twins_are_refused_with_the_way_to_tell_them_apart() -> None:
    twins = [Found("Pybricks Hub", f"00:16:53:00:00:0{n}") for n in (2, 1)]
    with pytest.raises(ConnectionError, match=r"2 hubs .*:02.*--hub 00:16:53:00:00:01"):
        SameDevice("hub").pick(twins)
    assert SameDevice("hub", "00:16:53:00:00:02").pick(twins) is twins[0]
    assert SameDevice("hub", "Anna").pick(twins) is None


def test_a_device_that_was_lost_is_named_and_its_twin_left_alone() -> None:
    same = SameDevice("hub")
    mine, twin = (Found("Pybricks Hub", f"00:16:53:00:00:0{n}") for n in (1, 2))
    same.chosen = mine
    assert same.pick([twin]) is None
    assert "another one is in reach" in same.name_absent([twin])
    assert same.pick([Found("renamed", mine.address), twin]) is not None
