"""Whichever fault occurs at whichever moment, the robot moves only on fresh messages.

Each run is drawn from a seed: (freeze | stall up | stall down | cut | reorder) x (before | while |
after each message) x (client gone | silent | back) x every message of the protocol, over the real
app, hub and loop in virtual time.
"""

from collections.abc import Callable, Coroutine
from typing import Any, NamedTuple

import pytest

from robot.control.state import Tick
from robot.testing import FakeCamera, FakePolicy, VirtualClock
from robot.types import Action, Mode, StopReason
from tests.faults.scenario import POINTS
from tests.kit.sizes import combined, crossed, size

from .virtual import Pilot, ServedWorld, Socket, in_virtual_time

FAULTS = ("freeze", "stall up", "stall down", "cut", "reorder")
MOMENTS = ("before", "while", "after")
CLIENTS = ("gone", "silent", "back")
MESSAGES = ("drive", "mode", "stop", "release", "take", "yield", "ping")
STEERED = ("moves", "degrees")
CASES = combined(FAULTS, MOMENTS, CLIENTS, MESSAGES, STEERED)
RUNS = max(len(CASES), size("RUNS", 0, 2_000))
"""Number of runs; they cover each case at least once."""
CHUNKS = size("CHUNKS", 1, 20)
OLDEST_S = 0.3
STANDS_WITHIN_S = 0.5
_EPSILON_S = 1e-6
_PICTURE = bytes(5000)
"""As many bytes as a JPEG of 160x120."""


class Sent(NamedTuple):
    """A message that a page has sent."""

    at_s: float
    kind: str
    seq: int | None


class Page(Pilot):
    """A pilot whose connection to the robot can be held up, cut or reordered."""

    def __init__(self, world: ServedWorld) -> None:
        self.stalls_up = self.stalls_down = self.reorders = False
        self.sent: list[Sent] = []
        self._late_up: list[tuple[Socket, str | bytes]] = []
        self._late_down: list[Callable[[], None]] = []
        super().__init__(world, sees=True)

    def grip(self, move: str | None) -> None:
        """From the next message on, hold a move; proportionally if the robot supports that."""
        self.held = move
        self.point = POINTS[move] if move and self._world.driver.takes_points else None

    def say(self, kind: str) -> None:
        """Send one message of a kind, as a page would."""
        if kind == "drive":
            self.hold(self.held, self.point)
        elif kind == "mode":
            self.mode("autonomous")
        elif kind == "release":
            self.release()
        else:
            self.send(type=kind, **({"client_ms": 1.0} if kind == "ping" else {}))

    def send(self, **message: Any) -> None:
        self.sent.append(Sent(self._world.clock.now_s(), message["type"], message.get("seq")))
        super().send(**message)

    def _up(self, socket: Socket, message: str | bytes) -> None:
        if self.stalls_up or (self.reorders and self._world.dice.random() < 0.5):
            self._late_up.append((socket, message))
        else:
            super()._up(socket, message)

    def _hear(self, text: str | bytes) -> None:
        self._down(super()._hear, text)

    def _see(self, message: str | bytes) -> None:
        self._down(super()._see, message)

    def _down(self, act: Callable[[str | bytes], None], message: str | bytes) -> None:
        if self.stalls_down:
            self._late_down.append(lambda: act(message))
        else:
            act(message)

    def deliver_what_is_late(self) -> None:
        """Release all held messages; `reorder` changes the order of those to the robot."""
        up, self._late_up = self._late_up, []
        down, self._late_down = self._late_down, []
        if self.reorders:
            self._world.dice.shuffle(up)
        self.stalls_up = self.stalls_down = self.reorders = False
        for socket, message in up:
            socket.send(message)
        for act in down:
            act()


async def driven(world: ServedWorld) -> Page:
    """Return a page that sees the picture of a robot that was taught a move for its view."""
    page = Page(world)
    await world.until(lambda: page.picture is not None and bool(page.state))
    frame, policy = world.camera.latest(), world.loop.history.policy
    point = POINTS[Action.FORWARD] if world.driver.takes_points else None
    policy.learn(policy.extract(frame), Action.FORWARD, None, point)
    return page


class Watch:
    """Checks every tick by the sent messages and their times, without the robot's own state."""

    def __init__(self, world: ServedWorld, page: Page) -> None:
        self._world, self._page = world, page
        self._mode = world.mode
        self.moves_s: list[float] = []
        self.faults: list[str] = []
        world.loop.subscribe(self._note)

    def _note(self, tick: Tick) -> None:
        now_s = self._world.clock.now_s()
        mode, before, self._mode = tick.decision.mode, self._mode, tick.decision.mode
        if tick.sent is not Action.STOP:
            self.moves_s.append(now_s)
        if mode is not Mode.STOPPED and before is not mode:
            asked_s = [sent.at_s for sent in self._page.sent if sent.kind == "mode"]
            self._check(now_s - max(asked_s, default=-1.0), OLDEST_S, f"{mode} was chosen")
        if mode is not Mode.STOPPED:
            sent_s = {sent.seq: sent.at_s for sent in self._page.sent}
            for command in tick.commands:
                self._check(now_s - sent_s[command.seq], OLDEST_S, "a command was sent")
            anything_s = max(sent.at_s for sent in self._page.sent)
            if tick.sent is not Action.STOP:
                self._check(now_s - anything_s, STANDS_WITHIN_S, "the page last sent anything")

    def _check(self, age_s: float, most_s: float, what: str) -> None:
        if age_s > most_s + _EPSILON_S:
            self.faults.append(f"{what} {1000 * age_s:.0f} ms before the robot acted upon it")


def _break(page: Page, fault: str, lasts_s: float) -> None:
    """Begin the fault. For a frozen process, only the clock has moved on when the freeze ends."""
    if fault == "freeze":
        page._world.clock.advance(lasts_s)
    elif fault == "stall up":
        page.stalls_up = True
    elif fault == "stall down":
        page.stalls_down = True
    elif fault == "reorder":
        page.reorders = True
    else:
        page.vanish()


async def play(world: ServedWorld, case: tuple[str, str, str, str]) -> list[str]:
    """Drive, cause the fault around the message, and return the violations."""
    fault, moment, client, kind = case
    dice, page = world.dice, await driven(world)
    await world.forward(dice.uniform(0.0, 0.2))
    watch = Watch(world, page)
    if dice.random() < 0.7:
        page.mode(dice.choice(["train", "autonomous"]))
        page.grip(dice.choice([None, "forward", "left"]))
        await world.forward(dice.uniform(0.15, 0.6))
    lasts_s = dice.choice([0.1, 0.31, 0.6, 1.0, 3.0]) * dice.uniform(0.9, 1.1)

    if moment == "before":
        _break(page, fault, lasts_s)
    page.say(kind)
    if moment == "after":
        await world.forward(dice.uniform(0.01, 0.1))
    if moment != "before":
        _break(page, fault, lasts_s)
    if client != "back":
        page.is_silent = True
    await world.forward(lasts_s)
    page.deliver_what_is_late()
    released_s = world.clock.now_s()
    if client == "gone":
        page.close()
    await world.forward(1.2)

    if kind == "stop" and (fault != "cut" or moment == "after"):
        if not world.loop.state.emergency:
            watch.faults.append("the stop was not obeyed")
        if any(at_s > released_s + 0.06 for at_s in watch.moves_s):
            watch.faults.append("it moved on after the stop had come")
    if client == "back" and fault != "cut" and not page.state["you_are_pilot"] and kind != "yield":
        watch.faults.append("the page lost the wheel for nothing")
    return watch.faults


def on_a_cheap_robot(
    scenario: Callable[[ServedWorld], Coroutine[Any, Any, list[str]]], seed: int, by: str
) -> list[str]:
    """Run a scenario without pixels, so that neither pictures nor learning take time."""
    clock = VirtualClock(100.0)

    async def main() -> list[str]:
        camera, policy = FakeCamera(clock, pictures=[_PICTURE]), FakePolicy()
        async with ServedWorld(clock, camera=camera, policy=policy, seed=seed) as world:
            world.driver.takes_points = by == "degrees"
            return await scenario(world)

    return clock.run(main())


@pytest.mark.parametrize("chunk", range(CHUNKS))
def test_nothing_moves_without_a_fresh_message(chunk):
    for number in range(chunk, RUNS, CHUNKS):
        *case, by = CASES[number % len(CASES)]
        faults = on_a_cheap_robot(lambda world, case=case: play(world, case), number, by)
        assert faults == [], f"run {number}: {case}"


@in_virtual_time()
async def test_a_stop_overtakes_all_messages_sent_before_it(world):
    pilot = await world.pilot(sees=True)
    pilot.mode("autonomous")
    await world.until(lambda: world.mode is Mode.AUTONOMOUS)
    for _ in range(400):
        pilot.send(type="ping", client_ms=1.0)
    pilot.send(type="stop")
    await world.until(lambda: world.loop.state.emergency, 0.1)
    assert "too_fast" in pilot.errors()


@crossed(kind=["drive", "mode"], lie=["no nonce", "another nonce", "no frame"], by=STEERED)
@in_virtual_time()
async def test_a_message_without_a_proof_moves_nothing(world, kind, lie, by):
    world.driver.takes_points = by == "degrees"
    pilot = await world.pilot(sees=True)
    if kind == "drive":
        pilot.mode("train")
        await world.until(lambda: world.mode is Mode.TRAIN)
    pilot.is_silent = True
    await world.forward(0.1)
    moved_s = world.driver.moved_s
    for _ in range(20):
        sight = pilot.sight() | {"seq": pilot.seq + 1}
        pilot.seq += 1
        sight |= {"no nonce": {"nonce": None}, "no frame": {"frame": None}}.get(
            lie, {"nonce": world.dice.randrange(1, 2**32)}
        )
        point = POINTS["forward"]._asdict() if by == "degrees" else {}
        what = {"held": "forward", **point} if kind == "drive" else {"mode": "autonomous"}
        pilot.send(type=kind, **what, **sight)
        await world.forward(0.05)
    assert world.driver.moved_s == moved_s, "the robot moved"
    assert world.mode is Mode.STOPPED
    assert set(pilot.errors()) == {"no_picture" if lie == "no frame" else "stale"}
    if kind == "drive":
        assert world.loop.state.decision.stop_reason is StopReason.LINK_SLOW
