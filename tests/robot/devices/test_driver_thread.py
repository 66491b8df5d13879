"""A body that needs 50 ms for each request does not delay the loop, and obeys the newest action."""

from __future__ import annotations

import heapq
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from unittest import mock

import pytest

from robot.clock import Worker
from robot.control.loop import ControlLoop
from robot.devices.driver_thread import SILENT_S, STALE_S, DriverThread
from robot.driver import ACTION_TIMEOUT_S, BodyButton, Driver, Sensors
from robot.errors import DriveError, NotConnectedError
from robot.exchange.replay_driver import ReplayDriver
from robot.policy.registry import make_policy
from robot.testing import VirtualClock
from robot.testing.driver import FakeDriver
from robot.types import Action, Mode, PilotCommand, Point, StopReason
from tests.robot.bench_robot import BenchCamera

TICK_S = 1 / 30


class StepClock(VirtualClock):
    """A driver thread that is not started, because the test runs its steps."""

    def start_thread(self, target: Callable[[], None], name: str) -> Worker:
        return mock.Mock()


@dataclass
class Body(ReplayDriver):
    """A body in virtual time that records each request and its time, and can fail."""

    clock: VirtualClock
    requests: list[tuple[float, str]] = field(default_factory=list)
    failure: Exception | None = None
    release: threading.Event | None = None
    """Actions hang until this event, if any, is set."""

    def __post_init__(self) -> None:
        super().__init__(clock=self.clock)
        self.speed = 1.0
        self.pressed: BodyButton | None = None

    def note(self, what: str) -> None:
        self.requests.append((self.clock.now_s(), what))
        if self.failure is not None:
            raise self.failure

    def send_action(self, action: Action, *, speed_scale: float = 1.0) -> Action:
        self.note(str(action))
        if self.release is not None:
            self.clock.wait(self.release, 30.0)
        self.speed = speed_scale
        return super().send_action(action, speed_scale=speed_scale)

    def sense(self) -> Sensors:
        self.note("sense")
        return Sensors(distance_m=self.clock.now_s())

    def stop(self) -> None:
        super().stop()
        self.note("halt")

    def take_button(self) -> BodyButton | None:
        pressed, self.pressed = self.pressed, None
        return pressed


@pytest.mark.parametrize("request_s", [0.02, 0.08])
def test_a_slow_body_costs_no_tick_no_example_and_no_distance(request_s: float) -> None:
    """Teach for 10 s: pictures and ticks at 30 Hz, a pilot at 10 Hz, and requests that take long.

    If such requests ran on the loop's own thread, half of the ticks would be lost.
    """
    clock = StepClock(1.0)
    body = Body(clock)
    driver = DriverThread(body, clock)
    camera = BenchCamera(clock)
    loop = ControlLoop(driver, camera, make_policy("published-8"), clock)
    driver.connect()
    loop.set_mode(Mode.TRAIN)
    events: list[tuple[float, int, str]] = [(1.0, 0, "tick"), (1.0, 1, "pilot"), (1.0, 2, "body")]
    seq, way = 0, 0.0
    while events[0][0] < 11.0:
        at_s, order, what = heapq.heappop(events)
        gone_s = max(at_s - clock.now_s(), 0.0)
        way += gone_s * body.speed * (body.action is not Action.STOP)
        clock.advance(gone_s)
        now_s = clock.now_s()
        if what == "tick":
            camera.show(1)
            loop.tick(now_s)
            next_s = TICK_S
        elif what == "pilot":
            seq += 1
            held = (Action.FORWARD, Action.LEFT, Action.RIGHT)[seq // 10 % 3]
            frame = camera.latest()
            frame_id = frame.frame_id if frame else None
            loop.command(PilotCommand(held=held, frame_id=frame_id, seq=seq, received_s=now_s))
            next_s = 0.1
        else:
            next_s = request_s if driver.step() and request_s else TICK_S / 4
        heapq.heappush(events, (now_s + next_s, order, what))
    assert not loop.state.stops
    assert loop.state.cycles >= 0.95 * 10.0 / TICK_S
    assert loop.history.taught.total() >= 0.95 * 9.0 / TICK_S
    assert way >= 0.95 * 9.0


def wrapped() -> tuple[VirtualClock, Body, DriverThread]:
    clock = StepClock(1.0)
    body = Body(clock)
    driver = DriverThread(body, clock)
    driver.connect()
    return clock, body, driver


def drain(driver: DriverThread) -> None:
    for _ in range(10):
        if not driver.step():
            return
    pytest.fail("the condition never holds")


def names(body: Body) -> list[str]:
    return [what for _, what in body.requests]


def test_the_wrapper_declares_what_its_body_declares() -> None:
    body = ReplayDriver(ReplayDriver.options_type(), VirtualClock())
    wrapped = DriverThread(body, VirtualClock())
    for name in (*Driver.__annotations__, "moves", "first_moves", "takes_advice"):
        if name != "is_remote":  # the thread makes a remote body local
            assert getattr(wrapped, name) == getattr(body, name), name


def test_only_the_newest_action_is_sent() -> None:
    _, body, driver = wrapped()
    drain(driver)
    for action in (Action.FORWARD, Action.LEFT, Action.RIGHT):
        driver.send_action(action)
    drain(driver)
    assert names(body) == ["sense", "right"]


def test_a_point_waits_and_is_sent_like_a_move() -> None:
    clock = StepClock(1.0)
    body = FakeDriver(clock=clock)
    body.takes_points = True
    driver = DriverThread(body, clock)
    drain(driver)
    assert driver.takes_points
    for point in (Point(0.5, 0.5), Point(-0.5, 0.25)):
        assert driver.send_point(point, speed_scale=0.5) is body.move_of(point)
    drain(driver)
    assert body.sent == [(Action.LEFT, 0.5)] and body.point == Point(-0.5, 0.25)
    driver.send_point(point)
    driver.stop()
    drain(driver)
    assert body.now is Action.STOP and len(body.sent) == 1
    with pytest.raises(ValueError, match="steering and throttle"):
        driver.send_point(Point(2.0, 0.5))


def test_a_stop_overtakes_everything_and_drops_waiting_actions() -> None:
    _, body, driver = wrapped()
    driver.send_action(Action.FORWARD)
    driver.stop()
    drain(driver)
    assert names(body)[0] == "halt" and "forward" not in names(body)
    driver.stop()
    driver.send_action(Action.LEFT)
    drain(driver)
    assert names(body)[-2:] == ["halt", "left"]


def test_an_action_that_waited_too_long_becomes_a_stop() -> None:
    clock, body, driver = wrapped()
    drain(driver)
    driver.send_action(Action.FORWARD)
    clock.advance(STALE_S + 0.01)
    drain(driver)
    assert "forward" not in names(body) and names(body)[-1] == "halt"


def test_a_new_action_goes_before_the_sensors_but_never_twice() -> None:
    clock, body, driver = wrapped()
    drain(driver)
    for index in range(40):
        driver.send_action((Action.LEFT, Action.RIGHT)[index % 2])
        clock.advance(0.05)
        driver.step()
    sensed = [at_s for at_s, what in body.requests if what == "sense"]
    assert max(b - a for a, b in pairwise(sensed)) <= 0.3
    assert names(body).count("left") + names(body).count("right") >= 20


def test_a_move_that_ends_does_so_before_the_sensors_however_late_they_are() -> None:
    clock, body, driver = wrapped()
    drain(driver)
    driver.send_action(Action.LEFT)
    driver.step()
    clock.advance(1.0)
    driver.send_action(Action.STOP)
    driver.step()
    assert names(body)[-1] == "stop"
    driver.send_action(Action.STOP)
    driver.step()
    assert names(body)[-1] == "sense", "only the first of two equal stops is sent"


@pytest.mark.parametrize(
    "error", [DriveError("the wheel is off"), RuntimeError("a bug"), SystemExit("no board")]
)
def test_a_fault_is_raised_until_a_request_succeeds(error: Exception) -> None:
    clock, body, driver = wrapped()
    drain(driver)
    body.failure = error
    driver.send_action(Action.FORWARD)
    drain(driver)
    for _ in range(2):
        with pytest.raises(type(error), match=str(error)):
            driver.send_action(Action.STOP)
    clock.advance(0.2)
    drain(driver)
    with pytest.raises(type(error)):
        driver.sense()
    body.failure = None
    clock.advance(0.2)
    driver.stop()
    drain(driver)
    driver.send_action(Action.STOP)
    assert driver.sense().distance_m == pytest.approx(clock.now_s())


def test_bad_actions_are_refused_at_once() -> None:
    _, body, driver = wrapped()
    with pytest.raises(ValueError, match="speed_scale"):
        driver.send_action(Action.FORWARD, speed_scale=2.0)
    with pytest.raises(ValueError, match="no_such"):
        driver.send_action(Action("no_such"))
    driver.disconnect()
    with pytest.raises(NotConnectedError):
        driver.send_action(Action.FORWARD)
    assert names(body) == ["halt"]


@pytest.mark.parametrize(("pressed", "heard"), [("START", None), ("STOP", BodyButton.STOP)])
def test_a_button_is_heard_once_and_a_start_that_came_during_a_fault_moves_nobody_later(
    pressed: str, heard: BodyButton | None
) -> None:
    clock, body, driver = wrapped()
    body.failure, body.pressed = DriveError("the sensor is off"), BodyButton[pressed]
    drain(driver)
    body.failure = None
    clock.advance(5.0)
    drain(driver)
    assert [driver.take_button(), driver.take_button()] == [heard, None]
    body.pressed = BodyButton.START
    clock.advance(0.2)
    drain(driver)
    assert [driver.take_button(), driver.take_button()] == [BodyButton.START, None]


def test_a_light_that_fails_is_reported_once_and_ends_no_thread(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The `show` method of a third-party driver may raise an error."""
    clock = VirtualClock()
    body = Body(clock)

    def fail(mode: Mode) -> None:
        raise TypeError("no such light")

    with DriverThread(body, clock) as driver:
        monkeypatch.setattr(body, "show", fail)
        driver.show(Mode.TRAIN)
        clock.sleep(0.2)
        with pytest.raises(TypeError, match="no such light"):
            driver.send_action(Action.STOP)
        assert driver.send_action(Action.FORWARD) is Action.FORWARD
        clock.sleep(0.2)
        assert body.action is Action.FORWARD


def test_a_body_that_hangs_delays_no_tick_and_is_reported_as_a_fault() -> None:
    """The body hangs in a request on the driver's own thread while the loop continues."""
    clock = VirtualClock()
    body = Body(clock, release=threading.Event())
    with DriverThread(body, clock) as driver:
        driver.send_action(Action.FORWARD)
        clock.sleep(0.1)
        driver.send_action(Action.LEFT)
        clock.advance(SILENT_S + 0.01)
        camera = BenchCamera(clock)
        loop = ControlLoop(driver, camera, make_policy("published-8"), clock)
        loop.set_mode(Mode.TRAIN)
        camera.show(1)
        loop.tick(clock.now_s())
        assert loop.mode is Mode.STOPPED
        assert loop.state.decision.stop_reason in (StopReason.DRIVE_FAULT, None)
        assert "does not answer" in (loop.state.fault or "")
        body.release.set()
    assert "forward" in names(body) and "left" not in names(body)
    assert body.action is Action.STOP and ACTION_TIMEOUT_S < SILENT_S


def test_disconnecting_leaves_no_thread_behind() -> None:
    before = set(threading.enumerate())
    clock = VirtualClock()
    with DriverThread(ReplayDriver(clock=clock), clock) as driver:
        driver.send_action(Action.FORWARD)
    assert set(threading.enumerate()) == before
