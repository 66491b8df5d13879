"""The contract of all drivers: a test suite to inherit, with a fixture `driver_case`."""

from __future__ import annotations

import contextlib
import gc
import math
import multiprocessing
import threading
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

import pytest

from robot.clock import RealClock
from robot.devices.options import options_of
from robot.devices.plugins import camera_names, load_driver
from robot.driver import ACTION_TIMEOUT_S, Sensors
from robot.errors import ConfigurationError, DriveError, NotConnectedError
from robot.moves import CLASSIC, describe, side_of
from robot.testing.cases import DriverCase
from robot.types import Action, Mode, Point

LOCAL_BUDGET_S = 0.01
"""Time limit for the fastest of several equal calls of a driver, in seconds. The limit is low,
because the control loop waits for each call."""
REMOTE_BUDGET_S = 0.2
"""Limit like `LOCAL_BUDGET_S`, for drivers that declare `is_remote`, in seconds. The limit is less
than 0.4 s, because a robot stops if its move is not renewed within that time."""
STANDS_WITHIN_S = 0.5
"""Time within which the body must stand still after its connection was cut, in seconds."""
CUTS_S = (0.5, 5.0)
BACK_WITHIN_S = 5.0
"""Time within which the body must obey after its connection was restored, in seconds. The limit is
the same after a short and a long cut."""
POINTS = [
    Point(steering, throttle) for steering in (-1.0, -0.5, 0.0, 0.4, 1.0) for throttle in (0.3, 0.8)
]
CORNERS = [
    Point(steering, throttle) for steering in (-1.0, 0.0, 1.0) for throttle in (-1.0, 0.5, 1.0)
]
_REAL = RealClock()
_REQUESTS = 20
_PATIENCE_S = 5.0
_LOOK_EVERY_S = 0.01
_GRACE_S = 0.1
"""Time by which the end of a move may be late, in seconds. On a busy machine the threads of the
driver and of the fake robot wake late."""
_CORRECTIONS = {"reverse": "both", "swap_sides": True, "trim": 0.1}
_STEP_S, _HALF_WAY_S = 0.1, ACTION_TIMEOUT_S / 2


def moving(case: DriverCase) -> bool:
    """Return whether the body moves; skip the test if the case cannot tell."""
    if case.is_moving is None:
        pytest.skip("whether this body moves is unknown; set is_moving in the case")
    return case.is_moving()


class DriverContract:
    """The tests that every driver must pass. Each test gets a case whose driver is not
    connected."""

    def test_it_declares_what_it_is(self, driver_case: DriverCase) -> None:
        """The driver declares its name, camera, options and moves before it is connected."""
        kind = type(driver_case.driver)
        found = load_driver(kind.name)
        assert found is kind, f"the entry point {kind.name!r} is {found}, not {kind}"
        known = ", ".join(camera_names())
        assert kind.default_camera in camera_names(), f"no camera {kind.default_camera!r}: {known}"
        without = [option.name for option in options_of(kind.options_type) if not option.help]
        assert not without, f"options without a help text (metadata={{'help': ...}}): {without}"
        moves = driver_case.driver.moves
        assert moves, "the driver declares no move"
        assert len(set(moves)) == len(moves), f"moves with the same name: {sorted(moves)}"
        assert Action.STOP not in moves, (
            "do not list 'stop' as a move: every robot can stop without it"
        )
        for move in describe(moves, driver_case.driver.declared_moves):
            assert move.name in CLASSIC or move.labels.get("en"), f"{move.name} needs a label"

    def test_stop_and_disconnect_are_safe_before_connect_and_twice(
        self, driver_case: DriverCase
    ) -> None:
        for _ in range(2):
            driver_case.driver.stop()
            driver_case.driver.disconnect()
        assert not driver_case.driver.is_connected, "is_connected is true before connect()"

    def test_connect_twice_is_one_connection(self, driver_case: DriverCase) -> None:
        driver_case.driver.connect()
        driver_case.driver.connect()
        assert driver_case.driver.is_connected, "is_connected is false after connect()"
        driver_case.driver.disconnect()
        assert not driver_case.driver.is_connected, "is_connected is true after disconnect()"

    def test_it_refuses_to_move_before_connect(self, driver_case: DriverCase) -> None:
        with pytest.raises(NotConnectedError):
            driver_case.driver.send_action(driver_case.driver.moves[0])

    def test_every_move_moves_and_stop_stops(self, driver_case: DriverCase) -> None:
        with driver_case.driver as driver:
            for move in driver.moves:
                _set_going(driver_case, move)
                _check_sent(driver.send_action(Action.STOP), Action.STOP, "send_action(STOP)")
                _check_stands(driver_case, f"after STOP, sent after {move}")
                _set_going(driver_case, move)
                driver.stop()
                _check_stands(driver_case, f"after stop(), called after {move}")

    def test_an_action_ends_by_itself(self, driver_case: DriverCase) -> None:
        """A body that receives no more orders stops after `ACTION_TIMEOUT_S`."""
        with driver_case.driver as driver:
            _check_goes_on(driver_case, driver.moves[0])
            driver_case.forward(ACTION_TIMEOUT_S)
            _check_ended(driver_case, _HALF_WAY_S + ACTION_TIMEOUT_S, f"{driver.moves[0]} was sent")

    def test_an_action_that_is_renewed_goes_on(self, driver_case: DriverCase) -> None:
        with driver_case.driver as driver:
            move = driver.moves[-1]
            for _ in range(5):
                driver.send_action(move)
                driver_case.forward(_HALF_WAY_S)
            _check_goes_on(driver_case, move)

    def test_bad_actions_are_refused(self, driver_case: DriverCase) -> None:
        with driver_case.driver as driver:
            for scale in (0.0, -1.0, 1.01, float("nan")):
                with pytest.raises(ValueError, match="speed_scale"):
                    driver.send_action(driver.moves[0], speed_scale=scale)
            for action in (*CLASSIC, Action("no_such_move")):
                if action not in driver.moves:
                    with pytest.raises(ValueError, match=action.value):
                        driver.send_action(action)
            _check_stays(driver_case, "the body moves after orders that were refused")

    def test_every_point_counts_as_a_move_and_drives(self, driver_case: DriverCase) -> None:
        """A body that does not accept steering and throttle drives the move that fits them best."""
        with driver_case.driver as driver:
            for point in POINTS:
                move = driver.move_of(point)
                send = partial(driver.send_point, point, speed_scale=0.5)
                _check_sent(send(), move, f"send_point({tuple(point)})")
                if move is not Action.STOP:
                    _check_moves(driver_case, send, f"the point {tuple(point)} ({move})")
                driver.stop()
                _check_stands(driver_case, f"after stop(), called after {tuple(point)}")
            if driver.send_point(Point(0.0, 0.0)) is Action.STOP:
                _check_stands(driver_case, "after the point (0, 0)")

    def test_a_point_that_is_not_renewed_ends(self, driver_case: DriverCase) -> None:
        with driver_case.driver as driver:
            driver.send_point(Point(0.3, 0.8))
            driver_case.forward(2 * ACTION_TIMEOUT_S)
            _check_ended(driver_case, 2 * ACTION_TIMEOUT_S, "the point (0.3, 0.8) was sent")

    def test_bad_points_are_refused(self, driver_case: DriverCase) -> None:
        with driver_case.driver as driver:
            for number in (-1.01, 1.01, math.inf, math.nan):
                for point in (Point(number, 0.5), Point(0.0, number)):
                    with pytest.raises(ValueError, match="steering and throttle"):
                        driver.send_point(point)
            with pytest.raises(ValueError, match="speed_scale"):
                driver.send_point(Point(0.0, 0.5), speed_scale=1.5)
            _check_stays(driver_case, "the body moves after points that were refused")
        with pytest.raises(NotConnectedError):
            driver.send_point(Point(0.0, 0.5))

    def test_right_is_positive_and_so_is_ahead(self, driver_case: DriverCase) -> None:
        """More steering never makes the body turn less. The steering and throttle of a move have
        the same effect as the move."""
        driver, drives = driver_case.driver, driver_case.drives
        with driver:
            if not driver.takes_points:
                points = [move.point for move in driver.declared_moves if move.point is not None]
                _check_points_as_moves(driver_case, points)
                return
            if drives is None:
                pytest.skip("how this body drives is unknown; set drives in the case")
            turned = []
            for steering in (-1.0, -0.6, -0.3, 0.0, 0.3, 0.6, 1.0):
                now = _driven(driver_case, partial(driver.send_point, Point(steering, 0.5)))
                turned.append(now.steering)
                asked = f"asked for steering {steering}, throttle 0.5: it drives {tuple(now)}"
                assert side_of(now.steering, 1e-9) == side_of(steering, 0.0), (
                    f"{asked}, which is not to this side"
                )
                assert now.throttle > 0.0 or abs(steering) > 0.5, f"{asked}, which is not ahead"
            assert turned == sorted(turned), f"with more steering it must not turn less: {turned}"
            if driver.move_of(Point(0.0, -0.5)) is not Action.STOP:  # the body can drive backwards
                back = _driven(driver_case, partial(driver.send_point, Point(0.0, -0.5)))
                assert back.throttle < 0.0, f"asked for throttle -0.5: {tuple(back)} is not back"
            for move in driver.declared_moves:
                if move.point is not None:
                    as_move = _driven(driver_case, partial(driver.send_action, move.name))
                    driver.stop()
                    _check_stands(driver_case, f"after stop(), called after {move.name}")
                    as_point = _driven(driver_case, partial(driver.send_point, move.point))
                    _check_same(as_point, as_move, f"the point of {move.name}")

    def test_a_correction_changes_the_motors_and_not_the_move(
        self, driver_case: DriverCase
    ) -> None:
        """If a correction does not apply to the body, the driver raises an error that names the
        correction. Skipped if the extension that corrects bodies is not installed."""
        corrections = pytest.importorskip("robot.adjustments.corrections")
        driver, drives = driver_case.driver, driver_case.drives
        make = corrections.BodyCorrection
        with driver:
            possible = corrections.possible_corrections(driver)
            for name, value in _CORRECTIONS.items():
                if name not in possible:
                    with pytest.raises(ConfigurationError, match=name):
                        corrections.check_correction(driver, make(**{name: value}))
            if "trim" not in possible or drives is None:
                return
            points = [Point(-0.6, 0.5), Point(0.0, 0.5), Point(0.6, 0.5)]
            plain = [_steered_to(driver_case, point) for point in points]
            driver.correct(make(swap_sides=True))
            swapped = [_steered_to(driver_case, point) for point in points]
            for before, after in zip(plain, swapped[::-1], strict=True):
                _check_same(after, before, "swapped sides")
            for trim in (-0.2, 0.2):
                driver.correct(make(trim=trim))
                now = _steered_to(driver_case, points[1])
                assert side_of(now.steering, 1e-9) == side_of(trim, 0.0), (
                    f"asked to go straight with trim {trim}: it drives {tuple(now)}, which is not "
                    "to this side"
                )
            driver.correct(make())
            _check_same(_steered_to(driver_case, points[0]), plain[0], "without a correction, it")

    def test_a_point_that_changes_quickly_is_driven_within_the_ramp(
        self, driver_case: DriverCase
    ) -> None:
        """When `ramp_s` has passed since the last change, the body drives with the ordered steering
        and throttle. During the ramp, the body's steering and throttle stay in the range of the
        values that the body reaches at the `CORNERS`."""
        driver, drives = driver_case.driver, driver_case.drives
        with driver:
            if not driver.takes_points:
                _check_points_as_moves(driver_case, CORNERS)
                return
            if drives is None:
                pytest.skip("how this body drives is unknown; set drives in the case")
            reached: dict[Point, Point] = {}
            for point in CORNERS:
                reached[point] = _driven(driver_case, partial(driver.send_point, point))
                driver.stop()
                _check_stands(driver_case, f"after stop(), called after {tuple(point)}")
            limits = [(min(of), max(of)) for of in zip(*reached.values(), strict=True)]
            for point in CORNERS[::-1] * 2:
                for passing in (Point(-point.steering, -point.throttle), point):
                    driver.send_point(passing)
                    now = drives()
                    if type(driver).is_remote and not _is_within(now, limits):
                        # only one wheel has received its message; wait for the other's
                        driver_case.forward(_LOOK_EVERY_S)
                        now = drives()
                    assert _is_within(now, limits), (
                        f"on the way to {tuple(passing)} it drives {tuple(now)}; at the corners "
                        f"steering and throttle are in {limits}"
                    )
                _hold(driver_case, partial(driver.send_point, point), driver_case.ramp_s)
                if not _comes(driver_case, lambda: _is_same(drives(), reached[point])):  # noqa: B023
                    _check_same(drives(), reached[point], f"{tuple(point)}, after other points,")

    def test_it_senses(self, driver_case: DriverCase) -> None:
        with driver_case.driver as driver:
            sensors = driver.sense()
            driver.show(Mode.TRAIN)
            driver.take_button()
        assert isinstance(sensors, Sensors), f"sense() returns {sensors!r}, not a Sensors object"
        for name, most in (("distance_m", 10.0), ("battery_share", 1.0)):
            read = getattr(sensors, name)
            assert read is None or 0.0 <= read <= most, (
                f"{name} must lie in [0, {most}], not {read}"
            )

    def test_leaving_the_context_stops_the_body(self, driver_case: DriverCase) -> None:
        with driver_case.driver as driver:
            driver.send_action(driver.moves[0])
        _check_stands(driver_case, "after disconnect()")
        if type(driver_case.driver).is_remote:
            driver_case.forward(REMOTE_BUDGET_S)
            _check_ended(driver_case, REMOTE_BUDGET_S, "disconnect()")

    def test_it_connects_again(self, driver_case: DriverCase) -> None:
        for _ in range(2):
            with driver_case.driver as driver:
                move = driver.moves[0]
                _check_sent(driver.send_action(move), move, f"send_action({move})")

    def test_requests_are_quick_enough(self, driver_case: DriverCase) -> None:
        """A driver that exceeds the latency budget must declare `is_remote`."""
        is_remote = type(driver_case.driver).is_remote
        budget_s = driver_case.budget_s or (REMOTE_BUDGET_S if is_remote else LOCAL_BUDGET_S)
        now_s = driver_case.now_s or _REAL.now_s
        with driver_case.driver as driver:
            for request in (lambda: driver.send_action(driver.moves[0]), driver.sense, driver.stop):
                took_s = _quickest_s(request, now_s)
                assert took_s <= budget_s, (
                    f"the quickest of {_REQUESTS} requests took {1000 * took_s:.0f} ms, but a "
                    f"request must take at most {1000 * budget_s:.0f} ms"
                    + ("" if is_remote else " unless the driver declares is_remote = True")
                )

    def test_it_leaves_nothing_behind(self, driver_case: DriverCase) -> None:
        """After `disconnect` the driver leaves no thread, no open file or socket, and no
        process."""
        for _ in range(2):  # twice, because imports of the first round may open files
            before = _leftovers()
            with driver_case.driver as driver:
                driver.send_action(driver.moves[0])
                driver.sense()
        end_s = _REAL.now_s() + _PATIENCE_S
        while (left := _leftovers() - before) and _REAL.now_s() < end_s:
            gc.collect()  # closes the files of objects that are no longer referenced
            _REAL.sleep(0.02)  # other threads may take a moment to end
        assert not left, f"{_PATIENCE_S:.0f} s after disconnect() there are still: {left}"

    def test_a_body_whose_line_is_cut_stands_and_the_driver_says_so(
        self, driver_case: DriverCase
    ) -> None:
        if driver_case.cut_link is None:
            pytest.skip("this connection cannot be cut: the case has no cut_link")
        with driver_case.driver as driver:
            _set_going(driver_case, driver.moves[0])
            driver_case.cut_link()
            said = False
            for _ in range(10):
                try:
                    driver.send_action(driver.moves[0])
                    driver.sense()
                except DriveError:
                    said = True
                    break
                driver_case.forward(STANDS_WITHIN_S / 10)
            driver_case.forward(STANDS_WITHIN_S)
            _check_cut_off(driver_case, STANDS_WITHIN_S)
            assert said, (
                "the line was cut, but ten calls of send_action and sense within "
                f"{1000 * STANDS_WITHIN_S:.0f} ms raised no DriveError. If the body acknowledges "
                "nothing, set gone_after_s and call heard() for each of its reports; if it sends "
                "nothing, let cut_link remove the port, so that the driver's next write fails"
            )

    def test_a_body_whose_line_is_whole_again_is_driven_again(
        self, driver_case: DriverCase
    ) -> None:
        """When the connection is restored, the driver connects again by itself and the body
        obeys."""
        if driver_case.cut_link is None or driver_case.restore_link is None:
            pytest.skip("this connection cannot be restored: the case has no restore_link")
        with driver_case.driver as driver:
            _set_going(driver_case, driver.moves[0])
            for cut_s in CUTS_S:
                driver_case.cut_link()
                for _ in range(round(cut_s / _STEP_S)):
                    _ask(driver_case, driver.moves[0], _STEP_S)
                _check_cut_off(driver_case, cut_s)
                driver_case.restore_link()
                is_back = _moves_within(driver_case, BACK_WITHIN_S, driver.moves[0], _STEP_S)
                assert is_back, (
                    f"{BACK_WITHIN_S:.0f} s after a cut of {cut_s} s the body still does not move, "
                    f"despite {round(BACK_WITHIN_S / _STEP_S)} orders; the last order "
                    f"{_last_error(driver_case)}"
                )


class TestDriver(DriverContract):
    """The suite that `pytest --drivelesson-driver NAME` runs on an installed driver."""


def _sets_going(case: DriverCase, order: Callable[[], object], tries: int | None = None) -> bool:
    """Return whether the body moves after at most `tries` orders. The default is one order, but
    `_REQUESTS` for a case with `budget_s`, because on a busy machine a move may end before it is
    checked."""
    for _ in range(tries or (_REQUESTS if case.budget_s else 1)):
        order()
        if _comes(case, lambda: moving(case)):
            return True
    return False


def _comes(case: DriverCase, is_so: Callable[[], bool]) -> bool:
    """Wait for `is_so`, for at most the body's budget; return whether it became true.

    A driver without acknowledgements may return before the robot has received the order. The budget
    is shorter than a move, so a move that arrived in time has not ended yet.
    """
    return _comes_within(case, is_so, min(_obeys_within_s(case), REMOTE_BUDGET_S))


def _comes_within(case: DriverCase, is_so: Callable[[], bool], left_s: float) -> bool:
    while not (came := is_so()) and left_s > 0.0:
        case.forward(_LOOK_EVERY_S)
        left_s -= _LOOK_EVERY_S
    return came


def _obeys_within_s(case: DriverCase) -> float:
    return case.budget_s or (REMOTE_BUDGET_S if type(case.driver).is_remote else 0.0)


def _check_moves(case: DriverCase, order: Callable[[], object], what: str) -> None:
    goes = _sets_going(case, order)
    waited_ms = 1000 * min(_obeys_within_s(case), REMOTE_BUDGET_S)
    assert goes, f"the body does not move {waited_ms:.0f} ms after {what} was sent"


def _set_going(case: DriverCase, move: Action) -> None:
    """Send a move and wait until the body moves. Without this wait, a stop or a cut connection
    could come before the body has begun to move."""
    send = case.driver.send_action
    _check_moves(case, lambda: _check_sent(send(move), move, f"send_action({move})"), str(move))


def _check_goes_on(case: DriverCase, move: Action) -> None:
    goes = _moves_within(case, 5 * _HALF_WAY_S, move, _HALF_WAY_S)
    assert goes, (
        f"{move} was sent five times, every {1000 * _HALF_WAY_S:.0f} ms, but the body never moved "
        f"{1000 * _HALF_WAY_S:.0f} ms after an order"
    )


def _check_ended(case: DriverCase, after_s: float, what: str) -> None:
    """Check that the body stands still after the longest duration of a move, `ACTION_TIMEOUT_S`."""
    assert _comes_within(case, lambda: not moving(case), _GRACE_S), (
        f"the body still moves {1000 * after_s:.0f} ms after {what}, but a move must end after "
        f"{1000 * ACTION_TIMEOUT_S:.0f} ms. Give the body a timeout, or let the driver inherit "
        "from HostWatchdog"
    )


def _check_cut_off(case: DriverCase, after_s: float) -> None:
    assert _comes_within(case, lambda: not moving(case), _GRACE_S), (
        f"the body still moves {1000 * after_s:.0f} ms after the line was cut. No order reaches it "
        "now, not even the stop of HostWatchdog, so it needs a timeout of its own. If it has none, "
        "cut_link must also stop the stand-in's motors, but the real robot will not stop"
    )


def _check_stays(case: DriverCase, otherwise: str) -> None:
    """Check that the body has not moved after the time in which a delayed order would arrive."""
    assert not _comes(case, lambda: moving(case)), otherwise


def _check_sent(sent: object, asked: Action, by: str) -> None:
    assert sent is asked, f"{by} returned {sent!r}, not {asked!r}"


def _check_points_as_moves(case: DriverCase, points: Iterable[Point]) -> None:
    """A body without proportional steering makes a move instead of each point. Check that
    `send_point` returns this move."""
    for point in points:
        sent = case.driver.send_point(point)
        _check_sent(sent, case.driver.move_of(point), f"send_point({tuple(point)})")


def _last_error(case: DriverCase) -> str:
    try:
        case.driver.send_action(case.driver.moves[0])
    except Exception as error:
        return f"failed: {error}"
    return "succeeded"


def _check_stands(case: DriverCase, when: str) -> None:
    stands = _comes(case, lambda: not moving(case))
    waited_ms = 1000 * min(_obeys_within_s(case), REMOTE_BUDGET_S)
    assert stands, f"the body still moves {waited_ms:.0f} ms {when}"


def _driven(case: DriverCase, send: Callable[[], object]) -> Point:
    """Send an order that changes how the body drives, wait for the change, and return how the body
    drives then. If a busy machine reads a remote body only after the move has ended, repeat the
    order."""
    drives = case.drives
    assert drives is not None
    if not type(case.driver).is_remote:
        send()
        _hold(case, send, case.ramp_s)
        return drives()
    for _ in range(_REQUESTS):
        before = drives()
        send()
        _comes(case, lambda: not _is_same(drives(), before))  # noqa: B023
        _hold(case, send, case.ramp_s)
        _settle(case)
        now = drives()
        if any(now):
            break
    return now


def _hold(case: DriverCase, send: Callable[[], object], seconds: float) -> None:
    """Repeat an order for some time, because the body may need longer than one order to reach its
    speed."""
    while seconds > 1e-9:
        step_s = min(seconds, _STEP_S)
        case.forward(step_s)
        send()
        seconds -= step_s


def _settle(case: DriverCase) -> None:
    """Wait until the body drives in the same way at two successive checks, because an order may
    consist of several messages, such as one for each wheel."""
    assert case.drives is not None
    looks = [case.drives()]

    def is_steady() -> bool:
        looks.append(case.drives())  # type: ignore[misc]
        return len(looks) > 2 and _is_same(looks[-1], looks[-2])

    _comes(case, is_steady)


def _away(now: Point, wanted: Point) -> float:
    return max(abs(a - b) for a, b in zip(now, wanted, strict=True))


def _is_same(now: Point, wanted: Point) -> bool:
    return _away(now, wanted) <= 1e-6


def _is_within(now: Point, limits: list[tuple[float, float]]) -> bool:
    parts = zip(now, limits, strict=True)
    return all(least - 1e-6 <= part <= most + 1e-6 for part, (least, most) in parts)


def _steered_to(case: DriverCase, point: Point) -> Point:
    """Send steering and throttle as the control loop does. Return the steering and throttle with
    which the body then drives. Check that `drive` returns the same move with any correction."""
    driver, move = case.driver, case.driver.move_of(point)
    now = _driven(case, lambda: _check_sent(driver.drive(move, point), move, "drive"))
    driver.stop()
    _check_stands(case, f"after stop(), called after {tuple(point)}")
    return now


def _check_same(now: Point, wanted: Point, what: str) -> None:
    assert _is_same(now, wanted), (
        f"{what} drives {tuple(now)}, not {tuple(wanted)}: {_away(now, wanted):.3g} apart"
    )


def _moves_within(case: DriverCase, seconds: float, move: Action, step_s: float) -> bool:
    """Send a move repeatedly, and check after each step whether the body moves. Return True if it
    moved at least once. One step is not enough, because on a busy machine a check may come too
    late."""
    return _sets_going(case, partial(_ask, case, move, step_s), round(seconds / step_s))


def _ask(case: DriverCase, move: Action, step_s: float) -> None:
    """Send a move and ignore errors, because the control loop also continues to send moves after
    an error."""
    with contextlib.suppress(DriveError):
        case.driver.send_action(move)
    case.forward(step_s)


def _quickest_s(request: Callable[[], object], now_s: Callable[[], float]) -> float:
    """Make several requests, and return the duration of the shortest one. The longer ones may have
    been slowed down by other programs on the machine."""
    taken_s = []
    for _ in range(_REQUESTS):
        start_s = now_s()
        request()
        taken_s.append(now_s() - start_s)
    return min(taken_s)


def _leftovers() -> set[object]:
    """Return the existing threads, processes and open files."""
    found: set[object] = {*threading.enumerate(), *multiprocessing.active_children()}
    folder = Path("/proc/self/fd")
    if folder.is_dir():
        for entry in folder.iterdir():
            try:
                found.add((entry.name, entry.readlink()))
            except OSError:  # a descriptor that `iterdir` used and has closed
                continue
    return found
