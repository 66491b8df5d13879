"""Descriptions of drivers and cameras under test, for the contract suites."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from robot.camera import Camera
from robot.driver import Driver
from robot.types import Point


@dataclass(frozen=True, slots=True)
class DriverCase:
    """A driver under test, with functions to let time pass and to observe the body.

    Attributes:
        driver: The driver, not connected yet.
        forward: Lets a time in seconds pass: `time.sleep`, or a virtual clock's `advance`.
        is_moving: Returns whether the body moves now. The function must read the state of the body,
            not of the driver. None if unknown; tests that need the function are skipped.
        cut_link: Cuts the connection to the body, in both directions; None if there is no
            connection. If the real body stops immediately when it loses the connection, this
            function must also stop the motors of the simulated body.
        now_s: The clock by which requests are timed; None means the machine's clock.
        budget_s: Longest duration of a request, in seconds; None means the contract's limit. A busy
            machine needs a higher limit.
        restore_link: Makes the body reachable again, by a new connection if the old one is lost;
            None if this is not possible.
        drives: Returns how the body turns and drives now, as steering and throttle in any scale,
            positive to the right and ahead; None if unknown. The function must read the state of
            the body, not of the driver.
        ramp_s: Longest time in which the body changes its steering and throttle, in seconds; 0 if
            there is no ramp.
    """

    driver: Driver
    forward: Callable[[float], None]
    is_moving: Callable[[], bool] | None
    cut_link: Callable[[], None] | None = None
    now_s: Callable[[], float] | None = None
    budget_s: float | None = None
    restore_link: Callable[[], None] | None = None
    drives: Callable[[], Point] | None = None
    ramp_s: float = 0.0


@dataclass(frozen=True, slots=True)
class CameraCase:
    """A camera, ready to start.

    Attributes:
        camera: The camera, not started yet.
        freeze: Makes the source deliver no more pictures, without closing it; None if this is not
            possible.
        thaw: Makes the source deliver pictures again; None if this is not possible.
    """

    camera: Camera
    freeze: Callable[[], None] | None = None
    thaw: Callable[[], None] | None = None
