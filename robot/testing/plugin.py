"""A pytest plugin for authors of drivers and cameras.

    pytest --drivelesson-driver NAME --drivelesson-camera NAME [--drivelesson-option KEY=VALUE]

This command runs the contract suites on the installed plugins with these names, in addition to the
package's tests. The hook `pytest_drivelesson_driver` in the package's conftest.py supplies a driver
whose body the suite can observe. Without the hook the suite drives the robot that the options name,
which may be a real robot.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TypeVar

import pytest

from robot.camera import Camera
from robot.clock import RealClock
from robot.devices.options import make_options
from robot.devices.plugins import load_camera, load_driver
from robot.driver import Driver
from robot.errors import RobotError
from robot.testing.cases import CameraCase, DriverCase

pytest.register_assert_rewrite("robot.testing.driver_contract", "robot.testing.camera_contract")
_T = TypeVar("_T")


class DriverKitHooks:
    """Hooks that a package's conftest.py may implement."""

    @pytest.hookspec(firstresult=True)
    def pytest_drivelesson_driver(self, name: str) -> AbstractContextManager[DriverCase] | None:
        """Return a context manager that yields the case for the driver with this name."""

    @pytest.hookspec(firstresult=True)
    def pytest_drivelesson_camera(self, name: str) -> AbstractContextManager[CameraCase] | None:
        """Return a context manager that yields the case for the camera with this name."""


def pytest_addhooks(pluginmanager: pytest.PytestPluginManager) -> None:
    """Declare the hooks."""
    pluginmanager.add_hookspecs(DriverKitHooks)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare the options."""
    group = parser.getgroup("drivelesson", "contract suites of robots")
    for kind in ("driver", "camera"):
        group.addoption(f"--drivelesson-{kind}", metavar="NAME", help=f"test this {kind}")
    group.addoption(
        "--drivelesson-option",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="an option of the driver or camera, if no conftest.py builds it",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Collect the contract suites of the named plugins in addition to the requested tests."""
    for kind in ("driver", "camera"):
        if config.getoption(f"--drivelesson-{kind}"):
            suite = Path(__file__).with_name(f"{kind}_contract.py")
            config.args.append(f"{suite}::Test{kind.capitalize()}")


@pytest.fixture
def driver_case(request: pytest.FixtureRequest) -> Iterator[DriverCase]:
    """Yield a new driver with the requested name."""
    config = request.config
    name = config.getoption("--drivelesson-driver")
    made = config.hook.pytest_drivelesson_driver(name=name) or nullcontext(
        DriverCase(_make_driver(config, name), RealClock().sleep, None)
    )
    with made as case:
        yield case
        case.driver.disconnect()


@pytest.fixture
def camera_case(request: pytest.FixtureRequest) -> Iterator[CameraCase]:
    """Yield a new camera with the requested name."""
    config = request.config
    name = config.getoption("--drivelesson-camera")
    made = config.hook.pytest_drivelesson_camera(name=name) or nullcontext(
        CameraCase(_make_camera(config, name))
    )
    with made as case:
        yield case
        case.camera.stop()


def _make_driver(config: pytest.Config, name: str) -> Driver:
    kind = _loaded(load_driver, name)
    return kind(make_options(kind.options_type, _options(config)))


def _make_camera(config: pytest.Config, name: str) -> Camera:
    kind = _loaded(load_camera, name)
    body = _make_driver(config, config.getoption("--drivelesson-driver") or "replay")
    return kind.for_driver(body, make_options(kind.options_type, _options(config)), RealClock())


def _loaded(load: Callable[[str], type[_T]], name: str) -> type[_T]:
    try:
        return load(name)
    except RobotError as error:
        raise pytest.UsageError(str(error)) from error


def _options(config: pytest.Config) -> dict[str, str]:
    pairs = (text.partition("=") for text in config.getoption("--drivelesson-option"))
    return {key.replace("-", "_"): value for key, _, value in pairs}
