"""Sends orders over a real connection, where a busy machine may delay an order or its answer."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest

from robot.driver import Driver
from robot.errors import DriveError
from robot.types import Action


def error_while_driving(driver: Driver, within_s: float = 60.0, but: str = "") -> str:
    """Drive like the loop; return the first error that does not contain `but`, or an empty text."""
    end_s = time.monotonic() + within_s
    while time.monotonic() < end_s:
        try:
            driver.send_action(Action.FORWARD)
            driver.sense()
        except DriveError as error:
            if not but or but not in str(error):
                return str(error)
        time.sleep(0.01)
    return ""


def send_until(
    driver: Driver,
    move: Action = Action.FORWARD,
    is_obeyed: Callable[[], bool] = lambda: True,
    *,
    speed_scale: float = 1.0,
) -> None:
    """Send an order again and again, until the driver reports no fault and the body obeys it."""
    for _ in range(1000):
        try:
            driver.send_action(move, speed_scale=speed_scale)
        except DriveError:
            time.sleep(0.02)
            continue
        if is_obeyed():
            return
    pytest.fail(f"the body never obeyed {move}")
