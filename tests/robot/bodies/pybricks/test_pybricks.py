"""The hub's program on Debian's micropython, and the driver over a stand-in for Bluetooth."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from collections.abc import Iterator
from types import SimpleNamespace
from unittest import mock

import pytest

from robot.bodies.pybricks.driver import PybricksDriver, PybricksOptions
from robot.driver import ACTION_TIMEOUT_S, Sensors
from robot.errors import DriveError, MissingExtraError
from robot.types import Action
from tests.contract.real_parts import as_reported, check_real_driver
from tests.kit.needed import ROOT, installed
from tests.kit.run import run
from tests.kit.wait import wait_until
from tests.robot.bodies.sending import error_while_driving, send_until
from tests.standins.pybricks_hub import PROGRAM, BleakError, FakeHub


@pytest.fixture
def hub() -> Iterator[FakeHub]:
    with FakeHub() as running:
        yield running


def driver_for(hub: FakeHub, name: str = "") -> PybricksDriver:
    return hub.driver(PybricksOptions(hub=name))


def moved(hub: FakeHub) -> list[tuple[str, float, int]]:
    """Return the motors' orders, except orders to brake."""
    return [told for told in hub.told if told[2]]


class Typist:
    """Writes lines to the hub's program without the driver."""

    def __init__(self, hub: FakeHub) -> None:
        self.hub, self.seq = hub, 0
        hub.end_program()
        hub.told.clear()
        hub.start_program()

    def order(self, text: str) -> int:
        """Write a line, and wait for the report on it; return the hub's time, in ms."""
        n_reports = len(self.hub.reports)
        self.hub.type(text.encode() + b"\n")
        wait_until(lambda: len(self.hub.reports) > n_reports, text)
        return int(self.hub.reports[-1].split()[1])

    def drive(self, text: str) -> None:
        """Order a move with the current time, again if a busy machine delivered the order late."""
        before = len(moved(self.hub))
        while len(moved(self.hub)) == before:
            self.seq += 1
            self.order(f"{text} {self.seq} {self.order('?')}")


@pytest.mark.realtime
def test_a_hub_is_driven_again_after_it_hung_or_was_lost(hub: FakeHub) -> None:
    """The whole test uses one hub, whose program runs until somebody ends it."""
    assert len(PROGRAM.read_text().splitlines()) <= 80, "the program fits on one page"
    a_hub_that_is_missing_or_runs_another_program_is_reported(hub)
    driver = driver_for(hub)
    check_real_driver(driver, as_reported(driver, lambda: hub.is_moving))
    moves_are_timed_by_the_hub(hub)
    a_program_that_hangs_ends_its_move_and_obeys_nothing_old(hub)
    a_lost_hub_is_driven_again_and_not_replaced_by_its_twin(hub)
    the_hubs_button_ends_the_drive_and_starts_it_again(hub)
    replayed_late_and_unknown_orders_only_stop(hub)
    rubbish_is_harmless(hub)


def a_hub_that_is_missing_or_runs_another_program_is_reported(hub: FakeHub) -> None:
    with (
        mock.patch.object(hub, "start_program", lambda: None),
        pytest.raises(DriveError, match=r"firmware/hub\.py"),
    ):
        driver_for(hub).connect()
    with mock.patch.object(hub, "name", "Anna"), driver_for(hub, "Anna"):
        pass
    with pytest.raises(DriveError, match=r"the hub 'Otto'.*in range"):
        driver_for(hub, "Otto").connect()
    with (
        mock.patch.object(hub, "is_in_reach", False),
        pytest.raises(DriveError, match="is it switched on"),
    ):
        driver_for(hub).connect()


def moves_are_timed_by_the_hub(hub: FakeHub) -> None:
    with driver_for(hub) as driver:
        hub.told.clear()
        send_until(driver, Action.LEFT, lambda: hub.light == "green", speed_scale=0.5)
        assert {told[:2] for told in moved(hub)} == {("A", 75.0), ("B", 75.0)}
        assert all(told[2] <= 400 for told in moved(hub))
        assert driver.sense() == Sensors(distance_m=0.42, battery_share=0.5)
        driver.send_action(Action.STOP)
        wait_until(lambda: hub.light == "blue")
        assert not hub.is_moving
        send_until(driver, Action.FORWARD, lambda: hub.light == "green")
        wait_until(lambda: hub.light == "red", "the hub notices the silence")
        assert hub.told[-1][2] == 0, "the robot also brakes"


def a_program_that_hangs_ends_its_move_and_obeys_nothing_old(hub: FakeHub) -> None:
    with driver_for(hub) as driver:
        send_until(driver, Action.FORWARD, lambda: hub.light == "green")
        hub.send_signal(signal.SIGSTOP)
        frozen_s = time.monotonic()
        assert "not answered" in error_while_driving(driver)
        assert all(end_s <= frozen_s + ACTION_TIMEOUT_S for end_s in hub.ends_s.values())
        hub.told.clear()
        hub.send_signal(signal.SIGCONT)
        send_until(driver)
    # The delayed orders came at least 500 ms late, so only later orders had an effect.
    assert len(moved(hub)) <= 2 * 3


def a_lost_hub_is_driven_again_and_not_replaced_by_its_twin(hub: FakeHub) -> None:
    with FakeHub(address="00:16:53:00:00:02") as twin, mock.patch.object(hub, "others", [twin]):
        with pytest.raises(DriveError, match=r"2 hubs in range match:.*--hub 00:16:53:00:00:01"):
            driver_for(hub).connect()
        with driver_for(hub, hub.address) as driver:
            assert driver.device == "'Pybricks Hub' (00:16:53:00:00:01)"
            send_until(driver, Action.FORWARD, lambda: hub.light == "green")
            hub.cut()
            assert "not answered" in error_while_driving(driver)
            wait_until(lambda: not hub.clients)
            lost = ":01) was lost, and is not in range (another hub is"
            wait_until(lambda: lost in error_while_driving(driver))
            assert not twin.told and not twin.clients
            hub.is_in_reach = True
            send_until(driver)
            assert not twin.told


def the_hubs_button_ends_the_drive_and_starts_it_again(hub: FakeHub) -> None:
    with driver_for(hub) as driver:
        send_until(driver, Action.FORWARD, lambda: hub.light == "green")
        hub.end_program()
        assert not hub.is_moving
        assert "button" in error_while_driving(driver)
        assert hub.process is None, "the driver does not restart a program that a person ended"
        hub.start_program()
        send_until(driver)


def replayed_late_and_unknown_orders_only_stop(hub: FakeHub) -> None:
    typist = Typist(hub)
    typist.drive("forward 400 1.0")
    assert len(moved(hub)) == 2
    seq, now_ms = typist.seq, typist.order("?")
    for order in (
        f"forward 400 1.0 {seq} {now_ms}",
        f"forward 400 1.0 {seq - 1} {now_ms}",
        f"forward 400 1.0 {seq + 1} {now_ms - 600}",
        f"dance 400 1.0 {seq + 2} {now_ms}",
        f"forward 400 0 {seq + 3} {now_ms}",
    ):
        typist.order(order)
        assert len(moved(hub)) == 2, order
    typist.seq += 3
    typist.drive("right 9999 7.5")
    last = moved(hub)[2:]
    assert [told[:2] for told in last] == [("A", -150.0), ("B", -150.0)]
    assert all(told[2] <= 500 for told in last), "an order lasts at most 500 ms, not 9999"


RUBBISH = ("", "?", "a b c d e", "forward x 1 2 0", "\xff\xfe", "forward 400 nan 3 x", "x" * 5000)


def rubbish_is_harmless(hub: FakeHub) -> None:
    typist = Typist(hub)
    for number, rubbish in enumerate(RUBBISH, 1):
        typist.order(rubbish)
        typist.drive("forward 400 1.0")
        assert len(moved(hub)) == 2 * number, rubbish


@pytest.mark.parametrize(
    "error",
    [
        FileNotFoundError(2, "No such file or directory"),
        BleakError("[org.freedesktop.DBus.Error.ServiceUnknown] The name org.bluez was not given"),
        BleakError("No Bluetooth adapters found."),
        None,
    ],
    ids=str,
)
def test_a_computer_without_bluetooth_or_without_the_library_says_so(
    monkeypatch: pytest.MonkeyPatch, error: Exception | None
) -> None:
    find = mock.AsyncMock(side_effect=error)
    scanner = SimpleNamespace(find_device_by_filter=find)
    library = SimpleNamespace(BleakScanner=scanner) if error else None
    monkeypatch.setitem(sys.modules, "bleak", library)
    with pytest.raises((DriveError, MissingExtraError)) as told:
        PybricksDriver(PybricksOptions()).connect()
    said = "this computer's Bluetooth is off or missing" if error else "drivelesson[pybricks]"
    assert said in str(told.value) and "org." not in str(told.value)


def test_a_foreign_client_finds_a_hub() -> None:
    """`pybricksdev` is by the firmware's authors; CI installs it only for this test."""
    path = installed("pybricksdev", "pybricksdev")
    client = (sys.executable, "-m", "tests.robot.bodies.pybricks.foreign_client")
    done = run(*client, cwd=ROOT, env={**os.environ, "PYTHONPATH": f"{path}{os.pathsep}{ROOT}"})
    assert done.returncode == 0, done.stderr
    saw = json.loads(done.stdout)
    assert [answer.split()[0] for answer in saw["answers"]] == ["0", "1", "2"]
    assert [told[:2] for told in saw["told"]] == [["A", -200], ["B", 200], ["A", 150], ["B", 150]]
    assert saw["refused"] == "BleakError" and 64 in saw["status"]
