"""Motors on pins: the logic of moves in virtual time, and the keeper's process with mock pins.

The robot stops, no matter which process dies.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from multiprocessing import Pipe
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.bodies.gpio.driver import GpioDriver, GpioOptions
from robot.bodies.gpio.keeper import _kill, keep
from robot.bodies.gpio.keeper_line import KeeperLine
from robot.bodies.gpio.wheels import Build, TimedMotors, steered, tracked
from robot.bodies.remote.orders import Order
from robot.bodies.remote.plain import encode_plain_order
from robot.clock import RealClock
from robot.errors import ConfigurationError, DriveError, MissingExtraError
from robot.moves import CLASSIC
from robot.testing import VirtualClock
from robot.types import Action
from tests.kit.needed import ROOT
from tests.kit.wait import wait_until
from tests.robot.bodies.sending import send_until

NUMBERS = st.one_of(st.floats(-1, 1), st.floats())
ORDERS = st.tuples(
    st.sampled_from(["stop", "dance", *CLASSIC]),
    st.integers(-10, 5000),
    st.floats(-1, 2, allow_subnormal=False),  # half of the smallest float rounds to 0
    st.integers(0, 40),
    st.integers(-100, 1500),
    st.just(()) | st.tuples(NUMBERS, NUMBERS),
)


class Motor:
    value = 0.3


CARS = ("servo_ends", "esc_pin", "servo_pin")
TRACKED = tracked(0.6, 0.4)
CAR = steered(0.6, 0.4, (0.9, -0.7))


def made(build: Build) -> tuple[TimedMotors, list[Motor]]:
    motors = [Motor(), Motor()]
    return TimedMotors(motors, build, lambda: True), motors


@given(
    st.lists(st.tuples(ORDERS, st.integers(0, 700)), max_size=30), st.sampled_from([TRACKED, CAR])
)
def test_each_move_ends_in_time_whatever_orders_come(
    sent: list[tuple[tuple, int]], build: Build
) -> None:
    wheels, motors = made(build)
    turning = motors if build is TRACKED else motors[:1]
    now_ms, moved_ms, highest = 10_000, -1000, 0
    for (move, for_ms, speed, seq, behind_ms, point), pause_ms in sent:
        words = (move, for_ms, speed, seq, now_ms - behind_ms, *point)
        report = wheels.obey(" ".join(map(str, words)).encode(), now_ms)
        is_sound = move != "dance" and for_ms > 0 and 0 < speed <= 1
        if is_sound and seq > highest and all(-1 <= number <= 1 for number in point):
            highest = seq
            may_move = move != "stop" and behind_ms < 500
            moved_ms = now_ms - behind_ms if may_move else -1000
            assert may_move or not any(motor.value for motor in turning)
            if may_move and not point and (build is TRACKED or "spin" not in move):
                assert any(motor.value for motor in turning)
        assert (report.seq, report.ms) == (highest, now_ms)
        for _ in range(pause_ms):  # the keeper checks the time when `left_ms` requires it
            now_ms += 1
            if wheels.left_ms(now_ms) == 0:
                wheels.tick(now_ms)
            if any(motor.value for motor in turning):
                assert now_ms - moved_ms < 500, "the time counts from the sender's newest report"
        assert all(abs(motor.value) <= 1 for motor in motors)
        assert point or all(abs(motor.value) <= 0.6 for motor in turning)


@pytest.mark.parametrize(
    ("build", "order", "values"),
    [
        (TRACKED, "forward 400 0.5 1 0", (0.3, 0.3)),
        (TRACKED, "left 400 0.5 1 0", (0.0, 0.2)),
        (TRACKED, "right 400 0.5 1 0", (0.2, 0.0)),
        (TRACKED, "backward 400 1 1 0", (-0.6, -0.6)),
        (TRACKED, "spin_left 400 1 1 0", (-0.4, 0.4)),
        (TRACKED, "spin_right 400 1 1 0", (0.4, -0.4)),
        (CAR, "stop 400 1 1 0", (0.0, 0.1)),
        (CAR, "forward 400 1 1 0", (0.6, 0.1)),
        (CAR, "left 400 0.5 1 0", (0.2, 0.9)),
        (CAR, "right 400 1 1 0 0.5 0.25", (0.25, -0.3)),
        (CAR, "backward 400 1 1 0 -1 -0.5", (-0.4, 0.9)),
        (CAR, "forward 400 1 1 0 0 1", (1.0, 0.1)),
    ],
)
def test_each_order_turns_the_right_motors(
    build: Build, order: str, values: tuple[float, float]
) -> None:
    """A car's throttle and servo: 0.9 is full left and -0.7 full right, so 0.1 is straight."""
    wheels, motors = made(build)
    assert [motor.value for motor in motors] == pytest.approx([0.0, 0.1 if build is CAR else 0.0])
    assert wheels.obey(order.encode(), 0).sensors.bumped is True
    assert [motor.value for motor in motors] == pytest.approx(values)


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("left_pins", "17"),
        ("left_pins", "17,99"),
        ("right_pins", "a,b"),
        ("bumper_pin", "1,2"),
        ("bumper_pin", "17"),
        ("right_pins", "17,23"),
        ("servo_ends", "1"),
        ("servo_ends", "1,1"),
        ("servo_ends", "nan,1"),
        ("servo_ends", "-1.1,1"),
        ("esc_pin", "12"),
        ("servo_pin", "12,13"),
    ],
)
def test_bad_options_are_refused_with_their_name(option: str, value: object) -> None:
    with pytest.raises(ConfigurationError, match="--" + option.replace("_", "-")):
        GpioOptions(**{"motor_board": "servo-esc" if option in CARS else "two-pwm", option: value})


DRIVES_ON = """
import sys, time
from pathlib import Path
from robot.types import Action
from tests.robot.bodies.gpio.test_gpio import driver_for
with driver_for(Path(sys.argv[1])) as driver:
    while True:
        driver.send_action(Action.FORWARD)
        print(driver._connection._process.pid, flush=True)
        time.sleep(0.05)
"""


KEEPS_MOCK_PINS = """
import sys
from gpiozero import Device
from gpiozero.pins.mock import MockFactory, MockPWMPin
from robot.bodies.gpio import keeper
notes = open(sys.argv.pop(1), "a", buffering=1)
class NotedPin(MockPWMPin):
    def _change_state(self, value):
        print(self.info.name, float(value), file=notes)
        return super()._change_state(value)
Device.pin_factory = MockFactory(pin_class=NotedPin)
keeper.main()
"""
"""The process that holds the pins, with gpiozero's mock pins; the process records the values that
are set."""


def driver_for(notes: Path) -> GpioDriver:
    driver = GpioDriver(GpioOptions())
    program = [sys.executable, "-c", KEEPS_MOCK_PINS, str(notes), json.dumps(driver.settings())]
    driver._open_line = lambda: KeeperLine(program, RealClock())
    return driver


def pins(notes: Path) -> dict[str, float]:
    """Return the last value that was set on each pin."""
    lines = [line.split() for line in notes.read_text().splitlines()]
    return {name: float(value) for name, value in lines}


def program_pid(driver: GpioDriver) -> int:
    assert isinstance(driver._connection, KeeperLine)
    return driver._connection._process.pid


def keeper_pid(driver: GpioDriver) -> int:
    """Return the program's child that holds the pins; 0 while there is none."""
    pid = program_pid(driver)
    return int((Path(f"/proc/{pid}/task/{pid}/children").read_text().split() or ["0"])[0])


@pytest.mark.realtime
def test_a_keeper_outlives_its_program_and_is_replaced_when_it_fails(tmp_path: Path) -> None:
    notes = tmp_path / "pins.txt"
    a_keeper_that_hangs_or_ends_is_replaced_by_a_standing_one(notes)
    for how in (signal.SIGSTOP, signal.SIGKILL):
        the_pins_are_low_after_the_program_has_ended(notes, how)


def the_pins_are_low_after_the_program_has_ended(notes: Path, how: signal.Signals) -> None:
    program = subprocess.Popen(
        [sys.executable, "-c", DRIVES_ON, str(notes)], stdout=subprocess.PIPE, text=True, cwd=ROOT
    )
    try:
        assert program.stdout is not None
        pid = int(program.stdout.readline())
        wait_until(lambda: pins(notes)["GPIO17"] == 0.6, "the motors run")
        os.kill(program.pid, how)
        wait_until(lambda: not any(pins(notes).values()), "the motors stop")
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


def a_keeper_that_hangs_or_ends_is_replaced_by_a_standing_one(notes: Path) -> None:
    with driver_for(notes) as driver:
        stays = keeper_pid(driver)
        for quiet in (signal.SIGTERM, signal.SIGHUP, signal.SIGINT):  # the keeper ignores them
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
            wait_until(lambda: not any(pins(notes).values()), "the motors stop")
            assert program_pid(driver) == program, "the driver still uses the same program"
        os.killpg(program, signal.SIGKILL)
        send_until(driver, Action.FORWARD, lambda: program_pid(driver) != program)
        last = keeper_pid(driver)
    wait_until(lambda: _state(last) == b"Z", "no process is left")


def test_a_keeper_that_ends_just_when_it_is_replaced_is_not_an_error() -> None:
    beyond_the_last = (1 << 22) + 1
    _kill(beyond_the_last, signal.SIGUSR1)


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
    """The next keeper starts slowly; meanwhile, the driver's thread must be able to send a STOP."""
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


class BurntMotor:
    """A motor whose pin fails when the motor should turn."""

    @property
    def value(self) -> float:
        return 0.0

    @value.setter
    def value(self, value: float) -> None:
        if value:
            raise OSError(5, "Input/output error")


def test_pins_that_fail_are_reported_and_the_other_motor_stops() -> None:
    sound, (line, theirs) = Motor(), Pipe()
    motors = TimedMotors([sound, BurntMotor()], TRACKED)
    with line, theirs:
        line.send_bytes(encode_plain_order(Order(Action.FORWARD, 400, 1.0, 1, 0)))
        with pytest.raises(OSError, match="Input/output"):
            keep(motors, theirs, VirtualClock())
    assert sound.value == 0.0


def test_missing_pins_and_a_missing_library_are_reported_in_a_sentence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """This machine has no pins."""
    with pytest.raises(DriveError, match=r"no GPIO pins.*; run it on the Raspberry Pi"):
        GpioDriver(GpioOptions()).connect()
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"drivelesson\[gpio\]"):
        GpioDriver(GpioOptions()).connect()
