"""Errors of a plug-in's code become one sentence that names the plug-in."""

from __future__ import annotations

from typing import Any

import pytest

from robot.devices.plugins import load_driver
from robot.devices.rig import Rig, build_rig
from robot.errors import CameraError, DriveError, PluginError, RobotError
from robot.exchange.replay_driver import ReplayDriver
from robot.policy.registry import make_policy
from robot.testing import FakeCamera, FakeDriver, VirtualClock

ODD: list[Exception] = [
    KeyError("port"),
    ValueError(),
    TimeoutError("timed out"),
    AttributeError("'NoneType' object has no attribute 'write'"),
    ModuleNotFoundError("No module named 'thymiodirect'"),
    RuntimeError("two\nlines\n" + 2000 * "x"),
]


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


def test_a_camera_that_breaks_when_it_is_made_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    class Broken(FakeCamera):
        name = "lens"
        for_driver = raising(ODD[0])

    monkeypatch.setattr("robot.devices.rig.load_driver", lambda name: FakeDriver)
    monkeypatch.setattr("robot.devices.rig.load_camera", lambda name: Broken)
    with pytest.raises(PluginError, match=r"camera 'lens' failed in for_driver: KeyError: 'port'"):
        build_rig("fake", camera="lens")


def test_a_camera_that_cannot_be_closed_leaves_no_body_connected(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = VirtualClock()
    driver, camera = ReplayDriver(clock=clock), FakeCamera(clock)
    rig = Rig(driver, camera, make_policy("published-8"), clock)
    rig.start()
    close = camera.stop

    def fail() -> None:
        close()
        raise RuntimeError("the library cannot close it")

    monkeypatch.setattr(camera, "stop", fail)
    with pytest.raises(CameraError, match="cannot close"):
        rig.stop()
    assert not driver.is_connected
