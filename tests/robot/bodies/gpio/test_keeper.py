"""The process that holds the pins, with gpiozero's mock pins: the robot stops whichever process
dies."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from multiprocessing import Pipe
from pathlib import Path

import pytest

from robot.bodies.gpio.driver import GpioDriver, GpioOptions
from robot.bodies.gpio.keeper import keep
from robot.bodies.gpio.keeper_line import KeeperLine
from robot.bodies.gpio.wheels import TimedMotors
from robot.bodies.remote.orders import Order
from robot.bodies.remote.plain import encode_plain_order
from robot.clock import RealClock
from robot.errors import DriveError, MissingExtraError
from robot.testing import VirtualClock
from robot.types import Action
from tests.kit.wait import wait_until
from tests.robot.bodies.gpio.test_wheels import TRACKED, Motor
from tests.robot.bodies.sending import send_until
from tests.standins.firmware import ROOT

DRIVES_ON = """
import sys, time
from pathlib import Path
from robot.types import Action
from tests.robot.bodies.gpio.test_keeper import driver_for
with driver_for(Path(sys.argv[1])) as driver:
    while True:
        driver.send_action(Action.FORWARD)
        print(driver._connection._process.pid, flush=True)
        time.sleep(0.05)
"""


def driver_for(notes: Path) -> GpioDriver:
    program = [sys.executable, "-m", "tests.standins.gpio_keeper", str(notes)]
    driver = GpioDriver(GpioOptions())
    wires = json.dumps(driver.settings())
    driver._open_line = lambda: KeeperLine([*program, wires], RealClock())
    return driver


@pytest.fixture
def notes(tmp_path: Path) -> Iterator[Path]:
    yield tmp_path / "pins.txt"


def pins(notes: Path) -> dict[str, float]:
    """Return the last value that was set on each pin."""
    lines = [line.split() for line in notes.read_text().splitlines()]
    return {name: float(value) for _, name, value in lines}


def program_pid(driver: GpioDriver) -> int:
    assert isinstance(driver._connection, KeeperLine)
    return driver._connection._process.pid


def keeper_pid(driver: GpioDriver) -> int:
    """Return the program's child that holds the pins; 0 while there is none."""
    pid = program_pid(driver)
    return int((Path(f"/proc/{pid}/task/{pid}/children").read_text().split() or ["0"])[0])


@pytest.mark.realtime
def test_a_keeper_outlives_its_program_and_is_replaced_when_it_fails(notes: Path) -> None:
    a_keeper_that_hangs_or_ends_is_replaced_by_one_that_stands(notes)
    for how in (signal.SIGSTOP, signal.SIGKILL):
        the_robots_program_ends_and_the_pins_are_low(notes, how)


def the_robots_program_ends_and_the_pins_are_low(notes: Path, how: signal.Signals) -> None:
    program = subprocess.Popen(
        [sys.executable, "-c", DRIVES_ON, str(notes)], stdout=subprocess.PIPE, text=True, cwd=ROOT
    )
    try:
        assert program.stdout is not None
        pid = int(program.stdout.readline())
        wait_until(lambda: pins(notes)["GPIO17"] == 0.6, "it drives")
        os.kill(program.pid, how)
        wait_until(lambda: not any(pins(notes).values()), "it stands")
        if how is signal.SIGKILL:
            wait_until(lambda: _state(pid) == b"Z", "the keeper has ended, too")
    finally:
        os.kill(program.pid, signal.SIGCONT)
        program.kill()
        program.communicate()


def _state(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/stat").read_bytes().rpartition(b")")[2].split()[0]
    except OSError:
        return b"Z"


def a_keeper_that_hangs_or_ends_is_replaced_by_one_that_stands(notes: Path) -> None:
    with driver_for(notes) as driver:
        stays = keeper_pid(driver)
        for quiet in (signal.SIGTERM, signal.SIGHUP, signal.SIGINT):  # as systemd ends a service
            os.kill(stays, quiet)
        send_until(driver, Action.FORWARD, lambda: pins(notes)["GPIO17"] == 0.6)
        assert keeper_pid(driver) == stays
        program = program_pid(driver)
        for how in (signal.SIGSTOP, signal.SIGKILL):
            send_until(driver, Action.FORWARD, lambda: pins(notes)["GPIO17"] == 0.6)
            first = keeper_pid(driver)
            os.kill(first, how)

            def is_another(first: int = first) -> bool:
                return keeper_pid(driver) not in (0, first) and not driver._trouble

            send_until(driver, Action.FORWARD, is_another)
            driver.stop()
            wait_until(lambda: not any(pins(notes).values()), "it stands")
            assert program_pid(driver) == program, "no other had to be started first"
        os.killpg(program, signal.SIGKILL)
        send_until(driver, Action.FORWARD, lambda: program_pid(driver) != program)
        last = keeper_pid(driver)
    wait_until(lambda: _state(last) == b"Z", "nothing is left behind")


ENDS_WHEN_GIVEN_UP = """
import os, signal, sys
from pathlib import Path
from robot.bodies.gpio.keeper import outlive
wait, tries = os.waitpid, Path(sys.argv[1])
def wait_and_be_told(*child):
    ended = wait(*child)
    os.kill(os.getpid(), signal.SIGUSR1)
    return ended
def work():
    with tries.open("a") as lines:
        print("tried", file=lines)
    if len(tries.read_text().split()) == 1:
        os.kill(os.getpid(), signal.SIGKILL)
os.waitpid = wait_and_be_told
outlive(work)
"""


def test_a_keeper_that_ends_just_as_it_is_given_up_is_replaced(tmp_path: Path) -> None:
    tries = tmp_path / "tries"
    subprocess.run([sys.executable, "-c", ENDS_WHEN_GIVEN_UP, str(tries)], check=True, cwd=ROOT)
    assert tries.read_text().split() == ["tried"] * 2


STARTS_ONCE = """
import sys, time
from multiprocessing.connection import Connection
from pathlib import Path
started = Path(sys.argv[1])
if started.exists():
    time.sleep(600)
started.touch()
line = Connection(0)
line.send_bytes(b"ready")
line.recv_bytes()
"""


def test_the_driver_does_not_wait_for_a_starting_keeper(tmp_path: Path) -> None:
    """The next keeper starts slowly, and meanwhile the driver's thread has a STOP to send."""
    started = tmp_path / "started"
    line = KeeperLine([sys.executable, "-c", STARTS_ONCE, str(started)], VirtualClock())
    try:
        first = line._process
        line.send(b"?")
        first.wait()
        for _ in range(3):
            with pytest.raises(ConnectionError, match="it ended, and is being restarted"):
                line.send(b"?")
        assert line._process is not first
        assert line._process.poll() is None
    finally:
        line._end()


def burn(motor: object, value: float) -> None:
    if value:
        raise OSError(5, "Input/output error")


Burnt = type("Burnt", (), {"value": property(lambda motor: 0.0, burn)})
"""A motor whose pin fails when it should turn."""


def test_pins_that_fail_are_shown_and_the_other_motor_stands() -> None:
    sound, (line, theirs) = Motor(), Pipe()
    motors = TimedMotors([sound, Burnt()], TRACKED)
    with line, theirs:
        line.send_bytes(encode_plain_order(Order(Action.FORWARD, 400, 1.0, 1, 0)))
        with pytest.raises(OSError, match="Input/output"):
            keep(motors, theirs, VirtualClock())
    assert sound.value == 0.0


def test_unavailable_pins_are_reported_in_a_sentence() -> None:
    """This machine has no pins."""
    with pytest.raises(DriveError, match=r"no GPIO pins.*; run it on the Raspberry Pi"):
        GpioDriver(GpioOptions()).connect()


def test_without_the_library_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"drivelesson\[gpio\]"):
        GpioDriver(GpioOptions()).connect()
