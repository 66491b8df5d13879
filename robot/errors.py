"""Every error of the robot. Messages say what, which device, and what to do next."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return ` (did you mean 'x'?)` for the nearest known word; nothing if none is near."""
    near = difflib.get_close_matches(word, list(known), n=1)
    return f" (did you mean {near[0]!r}?)" if near else ""


class RobotError(Exception):
    """Root of all errors that the project raises on purpose."""


class ConfigurationError(RobotError, ValueError):
    """An option, world, port or file given by a person is not usable."""


class MissingExtraError(RobotError, ImportError):
    """A library that this feature needs is not installed; the message names the extra."""

    def __init__(self, feature: str, extra: str) -> None:
        from robot.installation import install_command  # slow to import, and seldom needed

        super().__init__(
            f"{feature} needs drivelesson[{extra}], which is not installed; "
            f"install it with: {install_command(extra)}"
        )
        self.extra = extra


class PluginError(RobotError, LookupError):
    """No driver or camera of this name is installed, or it cannot be loaded."""


class NotConnectedError(RobotError, ConnectionError):
    """A driver was used before `connect` or after `disconnect`."""


class DriveError(RobotError, OSError):
    """A motor, a sensor or the line to them failed."""


class CameraError(RobotError, OSError):
    """A camera is missing, unplugged, frozen or gives what cannot be read."""


class RecordingError(RobotError, ValueError):
    """A recording, episode or model on disk is broken or of an unknown form."""


class NotFoundError(RobotError, LookupError):
    """No model, episode or thing in the trash has this name."""
