"""The fields of a state message, with all sensors of a body."""

import math
from dataclasses import replace

import pytest

from robot.driver import Sensors
from robot.testing import FakeCamera, FakeDriver, VirtualClock
from server.clients.telemetry import describe_devices
from tests.server.virtual import ServedWorld, in_virtual_time


@pytest.mark.parametrize("distance_m", [math.inf, -math.inf, math.nan, 1e308, 0.25])
@in_virtual_time(seed=3)
async def test_a_reading_that_is_not_a_number_still_reaches_the_page(world, distance_m):
    """Sensors report infinity if nothing is in range; JSON has no number for it."""
    pilot = await world.pilot(sees=True)
    driver = world.rig.driver
    sense = driver.sense

    def odd() -> Sensors:
        return replace(sense(), distance_m=distance_m)

    driver.sense = odd
    before = pilot.state["frame"]
    await world.clock.pause(2.0)
    assert pilot.state["frame"] > before + 10
    finite = distance_m if math.isfinite(distance_m) else None
    assert pilot.state["distance_m"] == finite


def test_found_devices_are_reported_and_a_plug_ins_own_attribute_is_not():
    driver, camera = FakeDriver(), FakeCamera(VirtualClock())
    assert describe_devices(driver, camera) == {}
    driver.device = object()
    camera.device = "C270 (serial number A17)"
    assert describe_devices(driver, camera) == {"camera_device": "C270 (serial number A17)"}

    class Unplugged(FakeDriver):
        @property
        def device(self) -> str:
            raise OSError("the port is gone")

    assert describe_devices(Unplugged(), camera) == {"camera_device": "C270 (serial number A17)"}


def test_a_pictures_age_is_reported_and_the_part_of_it_on_a_brick():
    clock = VirtualClock()
    camera = FakeCamera(clock, age_s=0.05)
    camera.source_age_s = 0.03  # the brick measures this part; its link adds the rest

    async def told() -> dict[str, float]:
        async with ServedWorld(clock, camera=camera) as world:
            pilot = await world.pilot(sees=True)
            await world.forward(3.0)
            ages: dict[str, float] = pilot.state["camera"]
            return ages

    ages = clock.run(told())
    assert ages["age_ms"] == pytest.approx(50, abs=5)
    assert ages["brick_ms"] == pytest.approx(ages["age_ms"] - 30, abs=0.2)
