"""Errors of a plug-in's code become one sentence that names the plug-in."""

from __future__ import annotations

import logging
from typing import Any

import pytest

from robot.control.loop import ControlLoop, LoopConfig
from robot.devices.plugins import load_driver
from robot.devices.rig import Rig, build_rig
from robot.errors import DriveError, PluginError, RobotError
from robot.policy.registry import make_policy
from robot.testing import FakeCamera, FakeDriver, VirtualClock
from robot.types import Action, Mode, StopReason

ODD: list[Exception] = [
    KeyError("port"),
    ValueError(),
    TimeoutError("timed out"),
    AttributeError("'NoneType' object has no attribute 'write'"),
    ModuleNotFoundError("No module named 'thymiodirect'"),
    RuntimeError("two\nlines\n" + 2000 * "x"),
]
CALLS = {"take_button": "take_button", "sense": "sense", "send_action": "drive", "show": "show"}


def raising(error: Exception) -> Any:
    def raises(*_: object, **__: object) -> None:
        raise error

    return raises


def check_sentence(said: str, call: str, error: Exception) -> None:
    assert said.count("the driver of the robot 'fake' failed in " + call) == 1, said
    assert type(error).__name__ in said and "\n" not in said and len(said) < 600


@pytest.mark.parametrize("error", ODD, ids=lambda error: type(error).__name__)
def test_a_robot_that_cannot_be_connected_is_one_sentence(
    error: Exception, caplog: pytest.LogCaptureFixture
) -> None:
    clock = VirtualClock()
    for call in ("connect", "disconnect"):
        driver = FakeDriver()
        driver.connect = driver.disconnect = raising(error)  # type: ignore[method-assign]
        if call == "disconnect":
            del driver.connect  # type: ignore[method-assign]
        rig = Rig(driver, FakeCamera(clock), make_policy("published-8"), clock)
        caplog.clear()
        with pytest.raises(DriveError) as raised:
            (rig.start if call == "connect" else rig.stop)()
        check_sentence(str(raised.value), call, error)
        assert any(record.exc_info for record in caplog.records), "the author needs the traceback"


@pytest.mark.parametrize("call", CALLS)
def test_a_call_that_fails_stops_the_robot_and_is_logged_once(
    call: str, caplog: pytest.LogCaptureFixture
) -> None:
    clock, driver, error = VirtualClock(), FakeDriver(), ODD[3]
    driver.connect()
    setattr(driver, call, raising(error))
    loop = ControlLoop(driver, FakeCamera(clock), make_policy("published-8"), clock, LoopConfig())
    loop.set_mode(Mode.TRAIN)
    for _ in range(5):
        clock.advance(0.05)
        state = loop.tick(clock.now_s())
    shown = state.fault
    assert shown is not None
    check_sentence(shown, CALLS[call], error)
    if call != "show":
        assert state.decision.stop_reason is StopReason.DRIVE_FAULT
    with_traceback = [r for r in caplog.records if r.levelno >= logging.ERROR and r.exc_info]
    assert 1 <= len([r for r in with_traceback if "failed in" in r.getMessage()]) <= 2
    assert driver.now is Action.STOP


def test_our_own_errors_pass_as_they_are() -> None:
    driver, clock = FakeDriver(), VirtualClock()
    said = DriveError("the cable is out")
    driver.connect = raising(said)  # type: ignore[method-assign]
    with pytest.raises(DriveError) as raised:
        Rig(driver, FakeCamera(clock), make_policy("published-8"), clock).start()
    assert raised.value is said


def test_a_module_that_breaks_when_it_is_loaded_or_made_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Broken(FakeDriver):
        def __init__(self, options: Any) -> None:
            raise ODD[0]

    class Point:
        name = "wheely"

        def load(self) -> type:
            raise SyntaxError("invalid syntax")

    monkeypatch.setattr("robot.devices.plugins.points", lambda group: [Point()])
    with pytest.raises(PluginError, match=r"'wheely' cannot be loaded: SyntaxError: invalid"):
        load_driver("wheely")
    monkeypatch.setattr(Point, "load", lambda self: Broken)
    with pytest.raises(RobotError, match=r"'wheely' failed in __init__: KeyError: 'port'"):
        build_rig("wheely")
