from __future__ import annotations

from robot.types import Action

from .virtual import ServedWorld, virtually


def test_the_robot_stands_within_half_a_second_when_the_pilot_is_silent() -> None:
    async def scenario(world: ServedWorld) -> tuple[float, list[tuple[float, Action]]]:
        pilot = await world.pilot(sees=True)
        pilot.mode("train")
        pilot.hold("forward")
        await world.until(lambda: world.driver.now is Action.FORWARD)
        pilot.is_silent = True
        took_s = await world.until(world.stands)
        await pilot.wait_for_state(mode="stopped", stop_reason="pilot_silent")
        pilot.is_silent = False
        await world.forward(5.0)
        assert world.stands(), "it waits for an explicit start"
        return took_s, world.driver.changes

    first = virtually(scenario)
    assert first[0] < 0.5
    assert virtually(scenario) == first, "the same to the last digit"
