"""Describes a driver or camera under test to the contract suites."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from robot.camera import Camera
from robot.driver import Driver
from robot.types import Point


@dataclass(frozen=True, slots=True)
class DriverCase:
    """A driver, and how a test lets time pass for it and asks whether the body moves.

    Attributes:
        driver: Not connected yet.
        forward: Lets seconds pass: `time.sleep`, or a virtual clock's `advance`.
        is_moving: Whether the body moves now; None if that is unknown: tests that need it
            are skipped. It must ask the body, not the driver.
        cut_link: Cuts the connection to the body, both ways; None if there is none. If only a new
            order stops the body, it also stops the motors of the stand-in.
        now_s: The clock on which requests are measured; None: the machine's.
        budget_s: How long a request may take; None: as long as the contract says. A machine that
            is busy with other things needs more.
        mend_link: Lets the body be reached again, by a new connection if the old one is lost; None
            if it cannot.
        drives: How the body turns and drives now, as a point of any scale, positive to the right
            and ahead; None if that is unknown. It must ask the body, not the driver.
        ramp_s: How long the body may take from one point to any other; 0: it does so at once.
    """

    driver: Driver
    forward: Callable[[float], None]
    is_moving: Callable[[], bool] | None
    cut_link: Callable[[], None] | None = None
    now_s: Callable[[], float] | None = None
    budget_s: float | None = None
    mend_link: Callable[[], None] | None = None
    drives: Callable[[], Point] | None = None
    ramp_s: float = 0.0


@dataclass(frozen=True, slots=True)
class CameraCase:
    """A camera, ready to start.

    Attributes:
        camera: Not started yet.
        freeze: Makes the source give no more pictures, without closing; None if it cannot.
        thaw: Makes it give pictures again; None if it cannot.
    """

    camera: Camera
    freeze: Callable[[], None] | None = None
    thaw: Callable[[], None] | None = None
