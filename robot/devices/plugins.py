"""Finds drivers and cameras by name among the entry points, built-in or from plugins."""

from __future__ import annotations

from typing import Any

from robot.camera import Camera
from robot.driver import Driver
from robot.entry_points import points
from robot.errors import MissingExtraError, PluginError, did_you_mean

DRIVERS = "drivelesson.drivers"
CAMERAS = "drivelesson.cameras"
DEFAULT = "drivelesson.default-robot"
"""Group of the entry point that names the default robot."""


def driver_names() -> list[str]:
    """Return the names of all installed drivers, sorted."""
    return sorted({point.name for point in points(DRIVERS)})


def camera_names() -> list[str]:
    """Return the names of all installed cameras, sorted."""
    return sorted({point.name for point in points(CAMERAS)})


def default_driver() -> str | None:
    """Return the name of the default robot; None if there is no default."""
    return min((point.name for point in points(DEFAULT)), default=None)


def load_driver(name: str) -> type[Driver]:
    """Return the driver class with this name.

    There is no fallback, because an error is better than the wrong robot.

    Raises:
        PluginError: If there is no plugin with this name, or it is not a driver.
        MissingExtraError: If a library that the driver needs is not installed.
    """
    return _load(DRIVERS, name, "robot", Driver)


def load_camera(name: str) -> type[Camera]:
    """Return the camera class with this name; raises the errors of `load_driver`."""
    return _load(CAMERAS, name, "camera", Camera)


def _load(group: str, name: str, kind: str, base: type[Any]) -> type[Any]:
    known = {point.name: point for point in points(group)}
    if name not in known:
        raise PluginError(
            f"unknown {kind} {name!r}{did_you_mean(name, known)}; "
            f"installed: {', '.join(sorted(known))}"
        )
    try:
        found = known[name].load()
    except MissingExtraError:
        raise
    except (Exception, SystemExit) as error:  # importing the module may raise any error
        said = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        raise PluginError(f"the {kind} {name!r} cannot be loaded: {said}") from error
    if not isinstance(found, type) or not issubclass(found, base):
        raise PluginError(f"the {kind} {name!r} is not a {base.__name__}: {found!r}")
    return found
