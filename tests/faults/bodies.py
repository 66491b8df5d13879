"""Measures in virtual time how each body reacts when its server is gone, for the page of faults.

Only the body itself can still act, because nothing sends it orders any more. Other tests kill and
freeze real processes: the server, the keeper of a Raspberry Pi's pins, and the sample firmware.
"""

from __future__ import annotations

import contextlib
import os
import random
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from robot.bodies.ev3.driver import Ev3Driver, Ev3Options
from robot.bodies.ev3.fake_brick import FakeBrick
from robot.bodies.ev3.remote_driver import Ev3RemoteDriver, Ev3RemoteOptions
from robot.bodies.ev3.stock_driver import Ev3StockDriver, Ev3StockOptions, StockBody
from robot.bodies.lego_education.driver import LegoEducationDriver, LegoEducationOptions
from robot.bodies.pybricks.driver import PybricksDriver, PybricksOptions
from robot.bodies.remote.driver import RemoteOptions
from robot.bodies.remote.udp import UdpDriver
from robot.bodies.remote.ws import WsDriver
from robot.bodies.ros.driver import RosDriver, RosOptions
from robot.clock import Clock
from robot.driver import Driver
from robot.errors import DriveError
from robot.testing import VirtualClock
from robot.types import Action, Point
from tests.robot.bodies.ev3.virtual_agent import VirtualAgent, close_motor
from tests.standins.double_motor import DoubleMotor
from tests.standins.ev3_stock import StockFirmware
from tests.standins.firmware_in_time import RunningFirmware, RunningHub, RunningProgram
from tests.standins.rosbridge_in_time import WatchedBridge

FAULTS = ("link lost", "server killed", "server frozen")
DRIVES = 50
"""Number of drives measured for the page."""
_STEP_S = 0.004
_MEMORY = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
"""A folder in memory for a brick's files, which are in memory on a real brick, too."""


@dataclass(frozen=True)
class TimedBody:
    """A body and its driver, which use the same clock.

    `hang_up` closes the line like the system after the server's process has ended. `lose` ends all
    traffic in both directions, except for messages in transit, and `regain` restores it. `freeze`
    delays the driver's own threads. `slow_down` makes each message take a given time. `wheels`
    returns the speeds of the left and the right wheel, in any unit.
    """

    driver: Driver
    clock: VirtualClock
    is_moving: Callable[[], bool]
    lose: Callable[[], None]
    regain: Callable[[], None] | None = None
    hang_up: Callable[[], None] = lambda: None
    freeze: Callable[[], None] = lambda: None
    tick: Callable[[], None] = lambda: None
    slow_down: Callable[[float], None] = lambda slowest_s: None
    wheels: Callable[[], tuple[float, float]] | None = None


def _losing(line: Any) -> dict[str, Callable[[], None]]:
    """Return two functions that set and clear `is_lost` of a line."""
    return {name: partial(setattr, line, "is_lost", name == "lose") for name in ("lose", "regain")}


@contextmanager
def _program(
    board_type: type[RunningProgram], driver_type: Callable[..., Any], options: Any, seed: int
) -> Iterator[TimedBody]:
    """A driver whose messages go to a running program."""
    clock = VirtualClock()
    board = board_type(clock, seed)
    board.start()
    driver = driver_type(options, clock)
    driver._open_line = board.line
    yield TimedBody(
        driver,
        clock,
        lambda: board.is_moving,
        **_losing(board),
        slow_down=partial(setattr, board, "slowest_s"),
        wheels=lambda: board.wheels,
    )
    board.end()


@contextmanager
def _ev3_stock(seed: int) -> Iterator[TimedBody]:
    """A brick with LEGO's firmware, which is the bytecode interpreter of the stand-in."""
    clock, chance = VirtualClock(), random.Random(seed)

    def ask(message: bytes) -> bytes:
        clock.sleep(chance.uniform(0.001, 0.05))
        answer = None if line.is_lost else brick.answer(message)
        if answer is None:
            clock.sleep(0.4)
            raise DriveError("the brick does not answer")
        return answer

    options = Ev3StockOptions(ultrasonic_port="none", touch_port="none")
    line = SimpleNamespace(is_lost=False, ask=ask, close=lambda: None)
    brick, driver = StockFirmware(clock.now_s), Ev3StockDriver(options)
    driver._open = lambda: StockBody(lambda: line, options.ports())
    yield TimedBody(
        driver, clock, lambda: brick.is_moving, **_losing(line), wheels=lambda: brick.wheels
    )


@contextmanager
def _gpio(seed: int) -> Iterator[TimedBody]:
    from robot.bodies.gpio.driver import GpioOptions
    from tests.standins.gpio import MockPins

    clock = VirtualClock()
    with MockPins(clock) as pins:
        driver, hang_up = pins.driver(GpioOptions()), pins.hang_up
        yield TimedBody(
            driver, clock, lambda: pins.is_moving, hang_up, hang_up=hang_up, tick=pins.tick
        )


@contextmanager
def brick_in_memory(clock: Clock | None) -> Iterator[FakeBrick]:
    """A brick made of files, which ends the moves of `run-timed` like the kernel."""
    with (
        tempfile.TemporaryDirectory(dir=_MEMORY) as folder,
        FakeBrick(Path(folder, "brick"), clock=clock) as brick,
    ):
        yield brick


def _wheels_of(brick: FakeBrick) -> tuple[float, float]:
    speeds = brick.speeds()
    return speeds.get("outB", 0), speeds.get("outC", 0)


@contextmanager
def _ev3_remote(seed: int) -> Iterator[TimedBody]:
    """The brick's agent."""
    clock = VirtualClock(100.0)
    with brick_in_memory(clock) as brick, VirtualAgent(brick) as agent:
        driver = Ev3RemoteDriver(Ev3RemoteOptions(brick=agent.address), agent.link())
        cut, mend, hang_up = agent.cut, agent.mend, agent.hang_up
        yield TimedBody(
            driver,
            clock,
            brick.is_moving,
            cut,
            mend,
            hang_up=hang_up,
            freeze=cut,
            wheels=partial(_wheels_of, brick),
        )
        driver.disconnect()


@contextmanager
def _ros(seed: int) -> Iterator[TimedBody]:
    clock = VirtualClock(100.0)
    bridge = WatchedBridge(clock, seed)
    driver = RosDriver(RosOptions(address="robot", watchdog=True), clock)
    driver.open_topics = bridge.open
    yield TimedBody(
        driver,
        clock,
        lambda: bridge.is_moving,
        bridge.lose,
        bridge.regain,
        slow_down=partial(setattr, bridge, "slowest_s"),
        wheels=lambda: bridge.wheels,
    )
    bridge.end()


def unplug_motors(driver: Ev3Driver, brick: FakeBrick, *sides: int) -> None:
    """Unplug the left (0) or right (1) motor, or both; if the server runs on the brick, the motors'
    cables are its line."""
    for side in sides:
        close_motor(driver, side)
        brick.unplug_motor(("outB", "outC")[side])


@contextmanager
def _ev3(seed: int) -> Iterator[TimedBody]:
    """A brick on which the server itself runs."""
    clock = VirtualClock(100.0)
    with brick_in_memory(clock) as brick:
        driver = Ev3Driver(Ev3Options(brick_root=str(brick.root)), clock)

        def unplug_one() -> None:  # the other wheel still has its order
            if "outC" in brick.motors:
                unplug_motors(driver, brick, 1)

        wheels = partial(_wheels_of, brick)
        yield TimedBody(driver, clock, brick.is_moving, unplug_one, wheels=wheels)
        driver.disconnect()


@contextmanager
def _lego_education(seed: int) -> Iterator[TimedBody]:
    clock = VirtualClock()
    motor = DoubleMotor(clock, random.Random(seed))
    driver = LegoEducationDriver(LegoEducationOptions(), clock, library=motor)
    yield TimedBody(driver, clock, lambda: motor.is_moving, **_losing(motor), tick=motor.tick)


_REMOTE = RemoteOptions(address="board", secret="geheim")
BODIES: dict[str, tuple[Callable[[int], AbstractContextManager[TimedBody]], str]] = {
    "udp": (
        partial(_program, RunningFirmware, UdpDriver, _REMOTE),
        "the firmware's own time limit",
    ),
    "ws": (partial(_program, RunningFirmware, WsDriver, _REMOTE), "the firmware's own time limit"),
    "pybricks": (
        partial(_program, RunningHub, PybricksDriver, PybricksOptions()),
        "the motors' timed move",
    ),
    "ev3-remote": (_ev3_remote, "the kernel's timed move, or the agent"),
    "ev3-stock": (_ev3_stock, "the motors' timed move"),
    "gpio": (_gpio, "the process that holds the pins"),
    "ev3": (_ev3, "the kernel's timed move"),
    "lego-education": (_lego_education, "the motor's timed move"),
    "ros": (_ros, "our watchdog on the robot: see [ROS 2](../howto/ros.md)"),
}
"""Maps each body to the function that makes it, and to the part that stops it."""


def stood_after_s(name: str, fault: str, seed: int, *, proportional: bool = False) -> float:
    """Drive a body, cause one fault at a random moment, and return the time until the body stood.

    A body without proportional steering drives the moves that correspond to the points.

    Raises:
        AssertionError: If the body never moved before the fault, or moves again after it stood.
    """
    chance = random.Random(seed)
    with BODIES[name][0](seed) as body:
        driver = body.driver
        driver.connect()

        def choose() -> Action | Point:
            if not proportional:
                return chance.choice(driver.moves)
            throttle = chance.choice((-1, 1)) * chance.uniform(0.2, 1.0)
            return Point(chance.uniform(-1.0, 1.0), throttle)

        def send(meant: Action | Point, speed_scale: float = 1.0) -> None:
            with contextlib.suppress(DriveError):
                if isinstance(meant, Point):
                    driver.send_point(meant, speed_scale=speed_scale)
                else:
                    driver.send_action(meant, speed_scale=speed_scale)

        end_s = body.clock.now_s() + chance.uniform(0.3, 1.5)
        meant, has_moved = choose(), False
        while body.clock.now_s() < end_s:
            if chance.random() < 0.1:
                meant = choose()
            send(meant, chance.uniform(0.2, 1.0))
            has_moved = pass_time(body, chance.uniform(0.0, 0.1)) or has_moved
        assert has_moved, "the body never moved"
        body.slow_down(chance.uniform(0.08, 1.2))
        send(meant)
        dict(zip(FAULTS, (body.lose, body.hang_up, body.freeze), strict=True))[fault]()
        began_s, last_s = body.clock.now_s(), 0.0
        for _ in range(400):
            # The server still sends, but without effect.
            if fault == "link lost" and chance.random() < 0.04:
                send(meant)
            if pass_time(body, _STEP_S):
                last_s = body.clock.now_s() - began_s
        return last_s


def pass_time(body: TimedBody, seconds: float) -> bool:
    """Let time pass; return whether the body moved at the end of this time."""
    end_s = body.clock.now_s() + seconds
    while body.clock.now_s() < end_s:
        body.clock.sleep(min(_STEP_S, end_s - body.clock.now_s()))
        body.tick()
    return body.is_moving()
