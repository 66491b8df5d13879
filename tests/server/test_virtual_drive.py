from __future__ import annotations

import asyncio

import pytest

from robot.testing import FakeCamera, LinkConditions, VirtualClock
from robot.types import Action, Mode, StopReason
from server.config import Config, Limits
from server.protocol import ErrorCode

from .live_robot import WEB
from .virtual import Pilot, ServedWorld, in_virtual_time, virtually


@pytest.mark.parametrize("rate_hz", [0.9, 1.0, 2.0, 4.0, 10.0])
def test_a_robot_with_a_slow_camera_is_driven_slowly_and_stands_when_it_freezes(
    rate_hz: float,
) -> None:
    clock = VirtualClock()
    camera = FakeCamera(clock, rate_hz=rate_hz, age_s=0.05)
    camera.source_age_s = 0.03  # at a brick, whose link takes the rest

    async def scenario() -> None:
        async with ServedWorld(clock, camera=camera) as world:
            await world.forward(6.0)
            pilot = await world.pilot(sees=True)
            await world.forward(3.0)
            pilot.mode("train")
            pilot.hold("forward")
            await world.until(lambda: world.driver.now is Action.FORWARD, 3.0)
            await world.forward(20.0)
            assert world.driver.now is Action.FORWARD, world.loop.state.decision
            assert world.loop.state.stops == {}, world.loop.state.stops
            taught = world.loop.state.taught[Action.FORWARD]
            assert taught >= 0.8 * 20 * min(rate_hz, 10.0) - 3
            told = pilot.state["camera"]
            assert told["brick_ms"] == pytest.approx(told["age_ms"] - 30, abs=0.2)
            scale = world.loop.state.decision.speed_scale
            assert scale <= max(0.3 * rate_hz, 0.05)
            camera.is_frozen = True
            last_s = clock.now_s()
            await world.until(world.stands)
            assert (clock.now_s() - last_s) * scale <= 0.5

    clock.run(scenario())


@in_virtual_time()
async def test_a_client_that_keeps_reconnecting_does_not_increase_the_rate_of_states(
    world: ServedWorld,
) -> None:
    """Before, a pupil with eight pages caused five hundred states a second for all clients."""

    pilot, pupil = await world.pilot(), await world.pilot()
    before = len(pilot.messages)
    for _ in range(50):
        pupil.send(type="idle")
        pupil.send(type="watch")
        await world.forward(0.02)
    told = [one for one in pilot.messages[before:] if one["type"] == "state"]
    assert 5 <= len(told) <= 15
    assert pupil.state["frame"] == pilot.state["frame"], "it is told when it is back"


def test_repeated_requests_for_the_wheel_do_not_flood_the_pilots_page() -> None:
    async def scenario(world: ServedWorld) -> list[float]:
        pilot, *pupils = [await world.pilot() for _ in range(4)]
        pilot.mode("train")
        told_s: list[float] = []
        for n in range(500):
            pilot.hold("forward")
            pupils[n % 3].send(type="take")
            await world.forward(0.02)
            asked = [one for one in pilot.messages if one.get("name") == "wheel_asked"]
            told_s += [0.02 * n] * (len(asked) - len(told_s))
        return told_s

    told_s = virtually(scenario)
    assert 5 <= len(told_s) <= 15 and told_s[0] < 0.1 and told_s[-1] > 8.0, "but it is told again"


@in_virtual_time(Config(web=WEB, limits=Limits(refused_before_closing=20)))
async def test_a_pilot_on_a_slow_link_is_not_disconnected(world: ServedWorld) -> None:
    """Before, a client that pressed start once a second was disconnected after five minutes."""

    pilot = await world.pilot(sees=True)
    world.link.conditions = LinkConditions(delay_s=0.16, jitter_s=0.05)
    for _ in range(30):
        pilot.mode("train")
        await world.forward(1.0)
    assert [
        client.refusals.shut_out.is_set() for client in world.hub.broadcast.clients.values()
    ] == [False]
    assert world.hub.refused[ErrorCode.STALE] > 20, "the link is as slow as that"
    for _ in range(20):
        pilot.send(type="dance")
    await world.until(lambda: not world.hub.broadcast.clients, what="who is hostile is sent away")


@in_virtual_time(Config(web=WEB, limits=Limits(idle_s=2.0)))
async def test_only_a_client_that_falls_silent_is_disconnected(world: ServedWorld) -> None:
    silent, talking = await world.pilot(), await world.pilot()
    await world.forward(5.0)
    assert len(world.hub.broadcast.clients) == 2
    silent.is_silent = True
    waited_s = await world.until(lambda: silent.socket.is_closed, what="the silent one is closed")
    assert 1.5 < waited_s < 2.5 and silent.socket.close_code == 1001
    await world.forward(5.0)
    assert not talking.socket.is_closed and len(world.hub.broadcast.clients) == 1


@pytest.mark.parametrize("part", ["note_lateness", "pass_on_if_lapsed", "publish_state"])
@in_virtual_time()
async def test_a_fault_in_the_hubs_timer_stops_the_robot_but_not_the_timer(
    world: ServedWorld, part: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    pilot, other = await world.pilot(sees=True), await world.pilot(sees=True)
    pilot.mode("train")
    pilot.hold("forward")
    await world.until(lambda: world.driver.now is Action.FORWARD)
    owners = (world.loop, world.hub.lease, world.hub.broadcast)
    owner = next(each for each in owners if hasattr(each, part))
    with monkeypatch.context() as broken:
        # `publish_state` fails for the named caller: a tick, or the timer without a tick.
        broken.setattr(owner, part, _fail)
        if part == "publish_state":
            world.camera.is_frozen = True
        await world.until(world.stands)
        await world.forward(1.0)
    world.camera.is_frozen = False
    assert "the timer stopped the robot" in caplog.text
    assert world.loop.state.decision.stop_reason in ("loop_fault", "frame_stale")
    pilot.is_silent = True
    other.send(type="take")
    await other.wait_for_state(you_are_pilot=True)


def _fail(*_: object) -> None:
    raise RuntimeError("something unforeseen")


async def keep_busy(world: ServedWorld, late_s: float, for_s: float) -> list[tuple[bool, float]]:
    """Hold the computer up again and again; return the robot's messages and its speed."""
    said = []
    until_s = world.clock.now_s() + for_s
    while world.clock.now_s() < until_s:
        world.clock._now_s += late_s  # nobody runs, ...
        await asyncio.sleep(1e-6)  # ... and then everything that is due
        await asyncio.sleep(world.dice.uniform(0.1, 0.3))
        state = world.loop.state
        said.append((world.loop.state.link.is_busy, state.decision.speed_scale))
    return said


async def driving(world: ServedWorld) -> Pilot:
    pilot = await world.pilot(sees=True)
    pilot.mode("train")
    await world.until(lambda: world.mode is Mode.TRAIN)
    pilot.hold("forward")
    await world.forward(1.0)
    assert not world.loop.state.link.is_busy
    return pilot


@pytest.mark.parametrize("late_s", [0.0, 0.01, 0.03])
@in_virtual_time()
async def test_a_computer_that_keeps_time_is_not_reported_as_busy(
    world: ServedWorld, late_s: float
) -> None:
    await driving(world)
    said = await keep_busy(world, late_s, 3.0)
    assert not any(is_busy for is_busy, _ in said)
    assert world.mode is Mode.TRAIN


@in_virtual_time()
async def test_a_late_computer_slows_down_before_it_stops_and_recovers(world: ServedWorld) -> None:
    pilot = await driving(world)
    said = await keep_busy(world, 0.15, 5.0)
    assert world.mode is Mode.TRAIN, "it drives on"
    assert (True, 0.5) in said
    assert all(speed == 0.5 for is_busy, speed in said if is_busy)
    await world.forward(3.0)
    assert (world.loop.state.link.is_busy, world.loop.state.decision.speed_scale) == (
        False,
        1.0,
    )
    assert pilot.state["busy"] is False


@in_virtual_time()
async def test_the_reason_of_a_stop_is_shown_while_the_robot_stands(world: ServedWorld) -> None:
    pilot = await driving(world)
    await keep_busy(world, 0.6, 2.0)
    await world.forward(20.0)
    decision = world.loop.state.decision
    assert decision.mode is Mode.STOPPED
    if decision.stop_reason is StopReason.LINK_SLOW:
        assert pilot.state["busy"] is True, "it is not the link's fault"
