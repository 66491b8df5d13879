"""Bodies that behave like real libraries: all stop in time with our watchdog, and without the
watchdog fail the contract suite."""

from __future__ import annotations

import contextlib
import random
from typing import Any, ClassVar
from unittest import mock

import pytest

from robot.devkit.connected_driver import ConnectedDriver
from robot.devkit.host_watchdog import HostWatchdog
from robot.errors import DriveError, NotConnectedError
from robot.testing import VirtualClock
from robot.testing.cases import DriverCase
from robot.testing.driver_contract import STANDS_WITHIN_S, DriverContract
from robot.types import Action, Point
from tests.kit.sizes import size

N_HISTORIES = size("HABITS", 30, 1000)


class Body:
    """A body that drives until another order; each subclass adds a habit of a real library."""

    fails: ClassVar[str] = "an_action_ends_by_itself"
    """The contract's test that this body fails without a watchdog."""
    is_acknowledged = True

    def __init__(self, clock: VirtualClock, seed: int) -> None:
        self.clock, self.chance = clock, random.Random(seed)
        self.changes: list[tuple[float, bool]] = []
        self.is_open = False

    def open(self) -> None:
        self.is_open = True

    def order(self, is_move: bool) -> None:
        """Receive an order, like the library's call."""
        self.take(is_move)

    def take(self, is_move: bool, after_s: float = 0.0) -> None:
        self.changes.append((self.clock.now_s() + after_s, is_move))

    def close(self) -> None:
        """Close the connection; the wheels turn on, as with the real robot's library."""
        self.is_open = False

    def is_moving(self) -> bool:
        now_s = self.clock.now_s()
        done = [each for each in sorted(self.changes, key=lambda each: each[0]) if each[0] <= now_s]
        return bool(done) and done[-1][1]


class DropsTheSecond(Body):
    """Loses the second of two orders within 1 ms."""

    fails = "every_move_moves_and_stop_stops"
    is_acknowledged = False
    last_s = -1.0

    def order(self, is_move: bool) -> None:
        last_s, self.last_s = self.last_s, self.clock.now_s()
        if self.last_s - last_s > 0.001:
            self.take(is_move)


class WaitsInsideAMove(Body):
    """The call of a move returns after a second; other threads may call meanwhile."""

    fails = "requests_are_quick_enough"

    def order(self, is_move: bool) -> None:
        self.take(is_move)
        if is_move:
            self.clock.sleep(1.0)


class DrivesOnAfterClose(Body):
    """A body whose library repeats the last order on its own thread until the process ends."""

    fails = "leaving_the_context_stops_the_body"
    is_acknowledged = False
    last = False

    def order(self, is_move: bool) -> None:
        self.last = is_move
        self.take(is_move)

    def close(self) -> None:
        super().close()
        self.take(self.last, 0.1)


class ClosesWithoutStop(Body):
    """Orders of the last 20 ms before `close` never leave the computer."""

    fails = "leaving_the_context_stops_the_body"
    is_acknowledged = False

    def close(self) -> None:
        super().close()
        left_s = self.clock.now_s() - 0.02
        self.changes = [each for each in self.changes if each[1] or each[0] < left_s]


class StopWaitsForTheMove(Body):
    """Each move runs for at least .3 s; a stop is obeyed only after that."""

    fails = "every_move_moves_and_stop_stops"
    ends_s = 0.0

    def order(self, is_move: bool) -> None:
        now_s = self.clock.now_s()
        if is_move:
            self.ends_s = now_s + 0.3
        self.take(is_move, 0.0 if is_move else max(0.0, self.ends_s - now_s))


class AcknowledgesNothing(Body):
    """One order in twenty is lost, and the others arrive up to 30 ms late."""

    is_acknowledged = False

    def order(self, is_move: bool) -> None:
        if self.chance.random() > 0.05:
            self.take(is_move, self.chance.uniform(0.01, 0.03))


class RaisesSometimes(Body):
    """One call in three fails; the order may have been obeyed or not."""

    fails = "every_move_moves_and_stop_stops"

    def order(self, is_move: bool) -> None:
        luck = self.chance.random()
        if luck > 1 / 6:
            self.take(is_move)
        if luck < 1 / 3:
            raise OSError(5, "Input/output error")


class Reorders(Body):
    """A later order may overtake an earlier order, by at most 60 ms."""

    fails = "leaving_the_context_stops_the_body"
    is_acknowledged = False

    def order(self, is_move: bool) -> None:
        self.take(is_move, 0.06 if is_move else 0.0)


class IsSlow(Body):
    """Each call takes 120 to 180 ms."""

    def order(self, is_move: bool) -> None:
        self.clock.sleep(self.chance.uniform(0.12, 0.18))
        self.take(is_move)


HABITS: list[type[Body]] = [
    Body,
    DropsTheSecond,
    WaitsInsideAMove,
    DrivesOnAfterClose,
    ClosesWithoutStop,
    StopWaitsForTheMove,
    AcknowledgesNothing,
    RaisesSometimes,
    Reorders,
    IsSlow,
]


class _Orders(ConnectedDriver[Body]):
    """A driver as a third-party author would write it."""

    name, default_camera, is_remote, takes_points = "habit", "phone", True, True

    def __init__(self, body: Body) -> None:
        super().__init__(clock=body.clock)
        self.body = body
        self.acknowledges = body.is_acknowledged

    def _open(self) -> Body:
        self.body.open()
        return self.body

    def _drive(self, action: Action, point: Point | None, speed_scale: float) -> None:
        if self.body.is_open:
            self.body.order(action is not Action.STOP)

    def _close(self, connection: Body) -> None:
        if connection.is_open:
            connection.close()


class Unwatched(_Orders):
    """A driver that relies on the library's `close` to stop the body."""

    def disconnect(self) -> None:
        self._close(self.body)
        super().disconnect()


class Watched(HostWatchdog[Body], _Orders):
    pass


def history(kind: type[Body], seed: int) -> None:
    """Drive at random, and let the caller fall silent, stop or leave; the body must then stop."""
    chance, clock = random.Random(seed), VirtualClock()
    body = kind(clock, seed)
    driver = Watched(body)
    while not driver.is_connected:
        with contextlib.suppress(DriveError):
            driver.connect()

    def send() -> None:
        with contextlib.suppress(DriveError):
            if chance.random() < 0.15:
                driver.stop()
            elif chance.random() < 0.1:
                driver.send_action(Action.STOP)
            elif chance.random() < 0.2:
                driver.send_point(Point(0.5, chance.choice((-0.5, 0.5))))
            else:
                driver.send_action(chance.choice(driver.moves))

    for _ in range(chance.randrange(1, 12)):
        send()
        clock.sleep(chance.choice((0.0, chance.uniform(0.0, 0.02), chance.uniform(0.0, 0.3))))
    end = chance.choice(("silence", "stop", "leave", "a stop during a move"))
    if end == "silence":
        with contextlib.suppress(DriveError):
            if chance.random() < 0.5:
                driver.send_point(Point(0.5, 0.5))
            else:
                driver.send_action(driver.moves[0])
    elif end == "a stop during a move":
        clock.start_thread(send, "mover")
        clock.sleep(chance.uniform(0.0, 0.2))
    called_s = clock.now_s()
    if end != "silence":
        driver.disconnect() if end == "leave" else driver.stop()
    clock.sleep(max(0.0, called_s + STANDS_WITHIN_S - clock.now_s()))
    for _ in range(100):
        assert not body.is_moving(), f"{kind.__name__}, history {seed}: it moves after {end}"
        clock.sleep(0.02)
    driver.disconnect()
    clock.sleep(0.5)
    assert not body.is_moving() and not body.is_open


@pytest.mark.parametrize("kind", HABITS)
def test_with_our_watchdog_every_body_stops_within_half_a_second(kind: type[Body]) -> None:
    for seed in range(N_HISTORIES):
        history(kind, seed)


def check(promise: str, kind: type[Body], driver_type: type[_Orders]) -> None:
    """Check one promise of the contract."""
    clock = VirtualClock()
    body = kind(clock, 1)
    case = DriverCase(driver_type(body), clock.sleep, body.is_moving, now_s=clock.now_s)
    getattr(DriverContract(), f"test_{promise}")(case)


@pytest.mark.parametrize("kind", HABITS)
def test_without_the_watchdog_the_contract_suite_finds_each_body(kind: type[Body]) -> None:
    with pytest.raises((AssertionError, DriveError)):
        check(kind.fails, kind, Unwatched)
    # these bodies also break other promises of the contract
    if kind not in (WaitsInsideAMove, RaisesSometimes):
        check("an_action_ends_by_itself", kind, Watched)


def test_a_slow_body_gets_its_stop_early() -> None:
    clock = VirtualClock()
    body = IsSlow(clock, 1)
    body.chance = mock.Mock(uniform=lambda *_: 0.15)
    with Watched(body) as driver:
        for _ in range(3):
            clock.sleep(1.0)
            began_s = clock.now_s()
            driver.send_action(driver.moves[0])
            assert body.is_moving()
            clock.sleep(began_s + STANDS_WITHIN_S - clock.now_s())
            assert not body.is_moving()


def test_a_stop_that_fails_is_sent_again_and_reported(caplog: Any) -> None:
    clock = VirtualClock()
    body = Body(clock, 0)
    driver = Watched(body)
    driver.connect()
    driver.send_action(driver.moves[0])
    tried: list[float] = []

    def refuse(is_move: bool) -> None:
        tried.append(clock.now_s())
        raise OSError(5, "Input/output error")

    body.order = refuse
    driver.disconnect()
    assert len(tried) >= 5 and tried[-1] - tried[0] > 0.3
    assert "'habit' did not accept a stop" in caplog.text
    with pytest.raises(NotConnectedError):
        driver.send_action(driver.moves[0])
