"""The hub's program on Debian's micropython, and the driver over a stand-in for Bluetooth."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator
from types import SimpleNamespace
from unittest import mock

import pytest

from robot.bodies.pybricks.driver import PybricksDriver, PybricksOptions
from robot.driver import ACTION_TIMEOUT_S
from robot.errors import DriveError, MissingExtraError
from robot.types import Action, Sensors
from tests.contract.real_parts import check_driver_on_its_real_line
from tests.kit.needed import installed
from tests.kit.run import run
from tests.kit.wait import wait_until
from tests.robot.bodies.sending import error_while_driving, send_until
from tests.standins.firmware import ROOT
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
    """Writes lines to the program past the driver, as a relay might."""

    def __init__(self, hub: FakeHub) -> None:
        self.hub, self.seq = hub, 0
        hub.start_program()

    def order(self, text: str) -> int:
        """Write a line, and wait for the report on it; return the hub's time, in ms."""
        assert self.hub.process is not None and self.hub.process.stdin is not None
        n_reports = len(self.hub.reports)
        self.hub.process.stdin.write(text.encode() + b"\n")
        self.hub.process.stdin.flush()
        self.hub.wait_until(lambda: len(self.hub.reports) > n_reports)
        return int(self.hub.reports[-1].split()[1])

    def drive(self, text: str) -> None:
        """Order a move as of now; again if a busy machine delivered it late."""
        before = len(moved(self.hub))
        while len(moved(self.hub)) == before:
            self.seq += 1
            self.order(f"{text} {self.seq} {self.order('?')}")


def test_the_program_fits_a_page() -> None:
    assert len(PROGRAM.read_text().splitlines()) <= 80


@pytest.mark.realtime
def test_a_hub_is_driven_again_after_it_hung_or_was_lost(hub: FakeHub) -> None:
    """One hub is used for all of this: its program runs until somebody ends it."""
    check_driver_on_its_real_line("pybricks")
    a_hub_without_our_program_is_told(hub)
    a_hub_is_found_by_its_name(hub)
    moves_are_timed_by_the_hub(hub)
    a_program_that_hangs_ends_its_move_and_obeys_nothing_old(hub)
    a_hub_that_nobody_talks_to_shows_it(hub)
    a_hub_that_comes_back_into_reach_is_driven_again(hub)
    a_lost_hub_is_not_replaced_by_its_twin(hub)
    the_hubs_button_ends_the_drive_and_starts_it_again(hub)
    for lines in (replayed_late_and_unknown_orders_only_stop, rubbish_is_harmless):
        hub.end_program()
        hub.told.clear()
        lines(hub)


def moves_are_timed_by_the_hub(hub: FakeHub) -> None:
    with driver_for(hub) as driver:
        hub.told.clear()
        send_until(driver, Action.LEFT, lambda: hub.light == "green", speed_scale=0.5)
        assert {told[:2] for told in moved(hub)} == {("A", 75.0), ("B", 75.0)}
        assert all(told[2] <= 400 for told in moved(hub))
        assert driver.sense() == Sensors(distance_m=0.42, battery_share=0.5)
        driver.send_action(Action.STOP)
        hub.wait_until(lambda: hub.light == "blue")
        assert not hub.is_moving


def a_program_that_hangs_ends_its_move_and_obeys_nothing_old(hub: FakeHub) -> None:
    with driver_for(hub) as driver:
        send_until(driver, Action.FORWARD, lambda: hub.light == "green")
        hub.freeze()
        frozen_s = time.monotonic()
        assert "not answered" in error_while_driving(driver)
        assert all(end_s <= frozen_s + ACTION_TIMEOUT_S for end_s in hub.ends_s.values())
        hub.told.clear()
        hub.thaw()
        send_until(driver)
    # The delayed orders came at least 500 ms late, so only later orders moved anything.
    assert len(moved(hub)) <= 2 * 3


def replayed_late_and_unknown_orders_only_stop(hub: FakeHub) -> None:
    typist = Typist(hub)
    typist.drive("forward 400 1.0")
    assert len(moved(hub)) == 2
    seq, now_ms = typist.seq, typist.order("?")
    typist.order(f"forward 400 1.0 {seq} {now_ms}")
    typist.order(f"forward 400 1.0 {seq - 1} {now_ms}")
    typist.order(f"forward 400 1.0 {seq + 1} {now_ms - 600}")
    typist.order(f"dance 400 1.0 {seq + 2} {now_ms}")
    typist.order(f"forward 400 0 {seq + 3} {now_ms}")
    assert len(moved(hub)) == 2
    typist.seq += 3
    typist.drive("right 9999 7.5")
    last = moved(hub)[2:]
    assert [told[:2] for told in last] == [("A", -150.0), ("B", -150.0)]
    assert all(told[2] <= 500 for told in last), "and not for its 9999 ms"


RUBBISH = ("", "?", "a b c d e", "forward x 1 2 0", "\xff\xfe", "forward 400 nan 3 x", "x" * 5000)


def rubbish_is_harmless(hub: FakeHub) -> None:
    typist = Typist(hub)
    for number, rubbish in enumerate(RUBBISH, 1):
        typist.order(rubbish)
        typist.drive("forward 400 1.0")
        assert len(moved(hub)) == 2 * number, rubbish


def a_hub_that_nobody_talks_to_shows_it(hub: FakeHub) -> None:
    with driver_for(hub) as driver:
        send_until(driver, Action.FORWARD, lambda: hub.light == "green")
        hub.wait_until(lambda: hub.light == "red")
        assert hub.told[-1][2] == 0, "it brakes, too"


def the_hubs_button_ends_the_drive_and_starts_it_again(hub: FakeHub) -> None:
    with driver_for(hub) as driver:
        send_until(driver, Action.FORWARD, lambda: hub.light == "green")
        hub.end_program()
        assert not hub.is_moving
        assert "button" in error_while_driving(driver)
        assert hub.process is None, "a program that a person ended is not started by us"
        hub.start_program()
        send_until(driver)


def a_hub_that_comes_back_into_reach_is_driven_again(hub: FakeHub) -> None:
    with driver_for(hub) as driver:
        send_until(driver, Action.FORWARD, lambda: hub.light == "green")
        hub.cut()
        assert "not answered" in error_while_driving(driver)
        wait_until(lambda: not hub.clients)
        hub.is_in_reach = True
        send_until(driver)


def a_lost_hub_is_not_replaced_by_its_twin(hub: FakeHub) -> None:
    with FakeHub(address="00:16:53:00:00:02") as twin, mock.patch.object(hub, "others", [twin]):
        with pytest.raises(DriveError, match=r"2 hubs in range match:.*--hub 00:16:53:00:00:01"):
            driver_for(hub).connect()
        with driver_for(hub, hub.address) as driver:
            assert driver.device == "'Pybricks Hub' (00:16:53:00:00:01)"
            hub.cut()
            wait_until(lambda: not hub.clients)

            def tells_of_both() -> bool:
                try:
                    driver.send_action(Action.FORWARD)
                except DriveError as error:
                    return ":01) was lost, and is not in range (another one is" in str(error)
                return False

            wait_until(tells_of_both)
            assert not twin.told and not twin.clients
            hub.is_in_reach = True
            send_until(driver)
            assert not twin.told


def a_hub_is_found_by_its_name(hub: FakeHub) -> None:
    with mock.patch.object(hub, "name", "Anna"), driver_for(hub, "Anna"):
        pass
    with pytest.raises(DriveError, match=r"the hub 'Otto'.*in range"):
        driver_for(hub, "Otto").connect()
    hub.is_in_reach = False
    with pytest.raises(DriveError, match="is it switched on"):
        driver_for(hub).connect()
    hub.is_in_reach = True


def a_hub_without_our_program_is_told(hub: FakeHub) -> None:
    with (
        mock.patch.object(hub, "start_program", lambda: None),
        pytest.raises(DriveError, match=r"firmware/hub\.py"),
    ):
        driver_for(hub).connect()


def test_without_the_library_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "bleak", None)
    with pytest.raises(MissingExtraError, match=r"drivelesson\[pybricks\]"):
        PybricksDriver(PybricksOptions()).connect()


NO_BLUETOOTH = (
    FileNotFoundError(2, "No such file or directory"),
    BleakError("[org.freedesktop.DBus.Error.ServiceUnknown] The name org.bluez was not provided"),
    BleakError("No Bluetooth adapters found."),
)


@pytest.mark.parametrize("error", NO_BLUETOOTH, ids=str)
def test_a_computer_without_bluetooth_says_so(
    monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    async def find(*_: object, **__: object) -> None:
        raise error

    scanner = SimpleNamespace(find_device_by_filter=find)
    monkeypatch.setitem(sys.modules, "bleak", SimpleNamespace(BleakScanner=scanner))
    with pytest.raises(DriveError, match="this computer's Bluetooth is off or missing") as told:
        PybricksDriver(PybricksOptions()).connect()
    assert "org." not in str(told.value)


def test_a_foreign_client_finds_a_hub(hub: FakeHub) -> None:
    """`pybricksdev` is by the firmware's authors; CI installs it only for this test."""
    path = installed("pybricksdev", "pybricksdev")
    client = (sys.executable, "-m", "tests.robot.bodies.pybricks.foreign_client")
    done = run(*client, cwd=ROOT, env={**os.environ, "PYTHONPATH": f"{path}{os.pathsep}{ROOT}"})
    assert done.returncode == 0, done.stderr
    saw = json.loads(done.stdout)
    assert [answer.split()[0] for answer in saw["answers"]] == ["0", "1", "2"]
    assert [told[:2] for told in saw["told"]] == [["A", -200], ["B", 200], ["A", 150], ["B", 150]]
    assert saw["refused"] == "BleakError" and 64 in saw["status"]
