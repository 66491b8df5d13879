"""A late release or start does not undo a STOP that its sender had not seen."""

import contextlib
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from robot.testing import LinkConditions
from robot.types import Mode
from server.bodies.eye_routes import EYE
from server.clients.emergency_stop import EmergencyStop
from server.gateway.roles import Role
from server.protocol import ProtocolError
from tests.kit.sizes import size

from .virtual import Pilot, ServedWorld, in_virtual_time, virtually

SLOW = LinkConditions(delay_s=0.4)


async def _by_http(world: ServedWorld) -> None:
    world.hub.latch_emergency("http", Role.VIEWER)


async def _by_eye(world: ServedWorld) -> None:
    world.hub.latch_emergency("eye", EYE)


async def _by_another_page(world: ServedWorld) -> None:
    before, world.link.conditions = world.link.conditions, LinkConditions()
    other = await world.pilot()
    other.send(type="stop")
    await world.until(lambda: world.hub.emergency.number > other.hello.get("stop_number", 0))
    world.link.conditions = before


async def _twice(world: ServedWorld) -> None:
    await _by_http(world)
    await _by_eye(world)


STOPS: dict[str, Callable[[ServedWorld], Awaitable[None]]] = {
    "http": _by_http, "eye": _by_eye, "page": _by_another_page, "twice": _twice,
}  # fmt: skip


async def _stopped(world: ServedWorld) -> Pilot:
    """Return a page that sees its own STOP; from then on, the link is slow."""
    pilot = await world.pilot(sees=True)
    pilot.send(type="stop")
    await pilot.wait_for_state(emergency=True)
    world.link.conditions = SLOW
    return pilot


async def _refusal(pilot: Pilot) -> dict[str, Any]:
    return await pilot.wait_for(lambda message: message["type"] == "error")


@pytest.mark.parametrize("newer", STOPS)
@in_virtual_time()
async def test_a_release_in_transit_does_not_undo_a_newer_stop(world, newer):
    pilot = await _stopped(world)
    pilot.release()
    await STOPS[newer](world)
    await world.forward(1.5)
    assert world.loop.state.emergency
    refusal = await _refusal(pilot)
    assert refusal["code"] == "newer_stop" and "STOP was pressed again" in refusal["message"]
    pilot.release()
    await world.until(lambda: not world.loop.state.emergency, 1.5, "the release is obeyed")


@in_virtual_time()
async def test_a_release_after_a_reconnection_names_the_stop_of_the_new_state(world):
    before = await _stopped(world)
    before.release()
    before.vanish()
    await _by_http(world)
    await world.forward(1.5)
    assert world.loop.state.emergency, "the release on the old connection came too late"
    after = await world.pilot(sees=True)
    after.send(type="release", stop_number=before.state["stop_number"])
    assert (await _refusal(after))["code"] == "newer_stop"
    after.release()
    await world.until(lambda: not world.loop.state.emergency, 1.5)


def test_a_message_to_an_earlier_server_never_names_a_stop_of_this_server():
    async def number(world: ServedWorld) -> int:
        return world.hub.emergency.number

    assert virtually(number) != virtually(number)


@pytest.mark.parametrize("nonce", ["fresh", "unknown"])
@in_virtual_time()
async def test_a_start_requested_before_a_stop_does_not_start_the_released_robot(world, nonce):
    """A pilot taps a mode; somebody else stops and releases the robot before that message
    arrives."""
    pilot = await world.pilot(sees=True)
    await world.forward(0.2)
    world.link.conditions = LinkConditions(delay_s=0.2)
    if nonce == "unknown":
        pilot.nonce = 1
    pilot.mode("autonomous")
    world.link.conditions = LinkConditions()
    await _by_http(world)
    await world.forward(0.05)
    world.loop.release_emergency()
    await world.forward(0.3)
    assert world.mode is Mode.STOPPED
    assert pilot.errors() == ["newer_stop"], "a page does not repeat such a start"
    pilot.mode("autonomous")
    await world.until(lambda: world.mode is Mode.AUTONOMOUS, 1.0, "a new start is obeyed")


@pytest.mark.parametrize(
    ("proven_s", "now_s", "is_refused"),
    [(9.9, 10.1, True), (10.0, 10.1, False), (9.9, 12.0, True), (9.9, 12.01, False)],
)
def test_each_stop_has_the_next_number_and_refuses_older_starts_for_two_seconds(
    proven_s, now_s, is_refused
):
    stop = EmergencyStop()
    first = stop.number
    stop.check_start(0, 9.0, 9.1)
    stop.press(Role.PILOT, 10.0)
    assert stop.number == first + 1 > 1
    with pytest.raises(ProtocolError) if is_refused else contextlib.nullcontext():
        stop.check_start(1, proven_s, now_s)


@pytest.mark.parametrize("seed", range(size("RELEASES", 3, 60)))
@in_virtual_time()
async def test_on_links_of_any_delay_no_order_undoes_a_stop_that_its_sender_had_not_seen(
    world, seed
):
    dice, seen = world.dice, {world.hub.emergency.number}
    pages = [await world.pilot(sees=True) for _ in range(2)]
    for _ in range(40):
        page = dice.choice(pages)
        step = dice.choice(["stop", "http", "eye", "release", "take", "mode", "pass", "pass"])
        if step in STOPS:
            await STOPS[step](world)
        elif step == "release":
            seen.add(page.state["stop_number"])
            page.release()
        elif step == "mode":
            page.mode(dice.choice(["train", "autonomous"]))
        elif step == "pass":
            world.link.conditions = LinkConditions(delay_s=dice.choice([0.0, 0.05, 0.3, 1.0]))
            await world.forward(dice.choice([0.0, 0.05, 0.5, 2.0]))
        else:
            page.send(type=step)
        await world.until(
            lambda: world.loop.state.emergency or world.hub.emergency.number in seen, 0.06, step
        )
