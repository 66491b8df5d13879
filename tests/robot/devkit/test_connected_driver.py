"""The base class of drivers reconnects, and does not restrict the names in an author's class."""

from __future__ import annotations

import random
import re
from typing import Any, ClassVar

import pytest

from robot.devkit.connected_driver import ConnectedDriver
from robot.devkit.host_watchdog import HostWatchdog
from robot.driver import Driver, Sensors
from robot.errors import DriveError, NotConnectedError
from robot.testing import VirtualClock
from robot.types import Action, Point
from tests.kit.sizes import seeds

HOOKS = {"_open", "_begin", "_drive", "_sense", "_close"}


class Radio:
    """A body that answers, or only reports ten times a second, and whose connection can be cut."""

    def __init__(self, clock: VirtualClock, answers: bool) -> None:
        self.clock, self.answers = clock, answers
        self.is_cut = False
        self.n_open, self.took = 0, list[Action]()

    def take(self, action: Action) -> None:
        if self.is_cut and self.answers:
            raise ConnectionResetError(104, "Connection reset by peer")
        if not self.is_cut:
            self.took.append(action)


class RadioDriver(ConnectedDriver[list[Radio]]):
    """A third-party author's driver, which itself does not handle lost connections."""

    name, default_camera, is_remote = "radio", "phone", True

    def __init__(self, radio: Radio) -> None:
        super().__init__(clock=radio.clock)
        self.radio = radio

    def _open(self) -> list[Radio]:
        if self.radio.is_cut and self.radio.answers:
            raise ConnectionRefusedError(111, "Connection refused")
        self.radio.n_open += 1
        return [self.radio]

    def _drive(self, action: Action, point: Point | None, speed_scale: float) -> None:
        self._connected()[0].take(action)

    def _close(self, connection: list[Radio]) -> None:
        connection.pop().n_open -= 1


class ReportingRadioDriver(RadioDriver):
    gone_after_s: ClassVar[float | None] = 0.4

    def _begin(self) -> None:
        self._clock.sleep(0.5)
        self._sense()

    def _sense(self) -> Sensors:
        if not self.radio.is_cut:
            self.heard()
        return Sensors()


@pytest.mark.parametrize("seed", seeds(8, 200))
@pytest.mark.parametrize("kind", [RadioDriver, ReportingRadioDriver])
def test_a_lost_connection_is_reported_within_half_a_second_and_soon_restored(
    kind: type[RadioDriver], seed: int
) -> None:
    chance, clock = random.Random(seed), VirtualClock()
    radio = Radio(clock, answers=kind is RadioDriver)
    driver = kind(radio)
    driver.connect()
    for _ in range(5):
        for _ in range(chance.randrange(1, 20)):
            driver.send_action(chance.choice(driver.moves))
            clock.sleep(chance.uniform(0.0, 0.2))
        radio.is_cut = True
        cut_s, said_s = clock.now_s(), None
        n_took = len(radio.took)
        while clock.now_s() < cut_s + chance.choice((0.7, 8.0)):
            request = chance.choice((driver.sense, lambda: driver.send_action(driver.moves[0])))
            try:
                request()
            except DriveError as error:
                assert "'radio'" in str(error) and "in range?" in str(error)
                said_s = said_s or clock.now_s()
            clock.sleep(chance.uniform(0.0, 0.05))
        assert said_s is not None and said_s - cut_s <= 0.5
        assert driver.is_connected and radio.n_open <= 1 and len(radio.took) == n_took
        radio.is_cut = False
        mended_s = clock.now_s()
        while True:
            try:
                driver.send_action(driver.moves[0])
                break
            except DriveError:
                clock.sleep(0.05)
        assert clock.now_s() - mended_s <= 1.5
        if kind is RadioDriver:
            assert radio.took[n_took:] == [Action.STOP, driver.moves[0]], "the body may have moved"
    driver.disconnect()
    assert radio.n_open == 0 and not driver.is_connected
    with pytest.raises(NotConnectedError):
        driver.sense()


def test_a_body_that_cannot_be_reached_is_not_connected() -> None:
    radio = Radio(VirtualClock(), answers=True)
    radio.is_cut = True
    driver = RadioDriver(radio)
    for _ in range(2):
        with pytest.raises(DriveError, match="'radio' cannot be reached: Connection refused; is"):
            driver.connect()
        assert not driver.is_connected
    radio.is_cut = False
    driver.connect()
    assert driver.is_connected


@pytest.mark.parametrize("base", [ConnectedDriver, HostWatchdog])
def test_an_author_may_take_any_private_name_that_is_no_hook(base: Any) -> None:
    names = {name for name in dir(base) if re.match("_(?!abc|is_)[a-z]", name)} - HOOKS
    assert {"_connection", "_clock", "_connected"} <= names
    radio = Radio(VirtualClock(), answers=True)

    class Wheely(base):
        name, default_camera = "wheely", "phone"

        def __init__(self) -> None:
            super().__init__(clock=radio.clock)
            vars(self).update(dict.fromkeys(names, 7))

        def _open(self) -> Radio:
            return radio

        def _drive(self, action: Action, point: Point | None, speed_scale: float) -> None:
            radio.take(action)

    with Wheely() as driver:
        driver.send_action(Action.LEFT)
        radio.is_cut = True
        with pytest.raises(DriveError, match="wheely"):
            driver.send_action(Action.LEFT)
        radio.is_cut = False
        driver.send_action(Action.RIGHT)
    assert radio.took[-1] is Action.STOP


@pytest.mark.parametrize(
    ("base", "name", "theirs"),
    [
        (ConnectedDriver, "drive", lambda self, left, right: None),
        (ConnectedDriver, "_close", lambda self: None),
        (ConnectedDriver, "sense", 5),
        (HostWatchdog, "stop", Driver.stop),
        (HostWatchdog, "send_action", Driver.send_action),
        (HostWatchdog, "disconnect", Driver.disconnect),
    ],
)
def test_a_name_that_the_base_calls_is_refused_in_a_sentence(
    base: Any, name: str, theirs: Any
) -> None:
    with pytest.raises(TypeError, match=rf"Wheely\.{name}.* replaces a method (that|with which)"):
        type("Wheely", (base,), {name: theirs})


def test_hooks_that_an_author_overrides_are_used() -> None:
    def stop(self: Any, hard: bool = False) -> None:
        pass

    assert type("Wheely", (ConnectedDriver,), {"stop": stop, "device": "COM3"}).stop is stop
