"""All errors of the robot. A message says what failed, with which device, and what to do next.

If a library is missing, the message contains the command that installs it.
"""

from __future__ import annotations

import difflib
import importlib
import json
import logging
import os
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

log = logging.getLogger(__name__)
_LONGEST_SAID = 300
"""Maximum length of another program's error message that is shown, in characters."""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return ` (did you mean 'x'?)` for the most similar known word; empty if none is similar."""
    near = difflib.get_close_matches(word, list(known), n=1)
    # A word that begins with another letter must be more similar: for `drive`, `new-driver` is not
    # suggested.
    if not near or (near[0][:1] != word[:1] and not difflib.get_close_matches(word, near, 1, 0.75)):
        return ""
    return f" (did you mean {near[0]!r}?)"


class RobotError(Exception):
    """Root of all errors that the project raises on purpose."""


class ConfigurationError(RobotError, ValueError):
    """The user gave an unusable option, world, port or file."""


class InUseError(ConfigurationError):
    """Another program uses a folder or port that only one program can use at a time."""


class MissingExtraError(RobotError, ImportError):
    """A library that this feature needs is not installed; the message names the extra."""

    def __init__(self, feature: str, extra: str) -> None:
        super().__init__(
            f"{feature} needs drivelesson[{extra}], which is not installed; "
            f"install it with: {install_command(extra)}"
        )
        self.extra = extra


def need(library: str, feature: str, extra: str) -> Any:
    """Import a library that belongs to an extra, and return the library.

    Raises:
        MissingExtraError: If the library is not installed.
    """
    try:
        return importlib.import_module(library)
    except ImportError as error:
        raise MissingExtraError(feature, extra) from error


class PluginError(RobotError, LookupError):
    """No driver or camera with this name is installed, or it cannot be loaded."""


class NotConnectedError(RobotError, ConnectionError):
    """A driver was called before `connect` or after `disconnect`."""


class DriveError(RobotError, OSError):
    """A motor, a sensor or the connection to it failed."""


class CameraError(RobotError, OSError):
    """A camera is missing, unplugged or frozen, or its pictures cannot be read."""


class RecordingError(RobotError, ValueError):
    """A file on disk (a model or a recorded run) is damaged or has an unknown format."""


UNREADABLE = (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError)
"""Errors that reading malformed data can raise, including `RecordingError` (a ValueError)."""


class NotFoundError(RobotError, LookupError):
    """Nothing in the store or its trash has this name."""


def reason(error: BaseException) -> str:
    """Return why something failed, without the number and the path of an OSError."""
    return str(getattr(error, "strerror", None) or str(error)[:300] or type(error).__name__)


@contextmanager
def told_as(
    kind: type[Exception], what: str, *errors: type[Exception], do: str = ""
) -> Iterator[None]:
    """Convert `errors` (OSError by default) to a `kind` that says what failed and what to do."""
    caught = errors or (OSError,)
    try:
        yield
    except caught as error:
        raise kind(f"{what}: {reason(error)}" + (f"; {do}" if do else "")) from error


class PluginErrors:
    """Converts the errors of one plugin's code to `RobotError`s.

    Errors of type `RobotError` pass unchanged, because they already say what is wrong. Any other
    error is converted, and its traceback is logged once for each message.

    Args:
        kind: Kind of the plugin: `robot` or `camera`.
        name: The name by which the plugin was chosen.
        error_type: Type of the errors that are raised instead; its only argument is the message.
        first: Called before anything is logged, because writing the log to a terminal may block.

    Example:
        >>> with PluginErrors("robot", "wheely", DriveError).named("connect"):
        ...     {}["port"]
        Traceback (most recent call last):
        robot.errors.DriveError: the driver of the robot 'wheely' failed in connect: \
KeyError: 'port'; the log has the traceback: send that to the plug-in's author
    """

    def __init__(
        self,
        kind: str,
        name: str,
        error_type: type[RobotError],
        first: Callable[[], None] = lambda: None,
    ) -> None:
        self._what = f"the driver of the robot {name!r}" if kind == "robot" else f"{kind} {name!r}"
        self._error_type, self._first = error_type, first
        self._said = ""

    @contextmanager
    def named(self, call: str) -> Iterator[None]:
        """Convert the errors of one call of the plugin's code."""
        try:
            yield
        except RobotError:
            raise
        except (Exception, SystemExit) as error:  # libraries call exit()
            raise self.converted(call, error) from error

    def converted(self, call: str, error: BaseException) -> RobotError:
        """Log an error of one call, and return the error to raise in its place."""
        self._first()
        said = " ".join(f"{type(error).__name__}: {error}".split())[:_LONGEST_SAID]
        said = f"{self._what} failed in {call}: {said.removesuffix(': ')}"
        if said != self._said:  # log it once, although it may occur thirty times a second
            self._said = said
            log.error(said, exc_info=error)
        return self._error_type(
            f"{said}; the log has the traceback: send that to the plug-in's author"
        )


def install_command(extra: str) -> str:
    """Return the command that adds an extra's libraries to this installation."""
    wanted = f"drivelesson[{extra}]"
    clone = _clone()
    if clone is not None:
        return f"{_pip_install()} --editable {quoted(f'{clone}[{extra}]')}"
    source = _source()
    wanted = quoted(f"{wanted} @ {source}" if source else wanted)
    places = Path(sys.prefix).parts
    if "uv" in places and "tools" in places:
        return f"uv tool install --force {wanted}"
    if "uv" in places:  # uvx keeps its environments in uv's cache
        return f"uvx --from {wanted} drivelesson"
    if "pipx" in places:
        return f"pipx install --force {wanted}"
    return f"{_pip_install()} {wanted}"


def _clone() -> Path | None:
    """Return the folder of the source code if this program runs from source, else None."""
    folder = Path(__file__).resolve().parents[1]
    return folder if (folder / "pyproject.toml").is_file() else None


def _source() -> str | None:
    """Return the file or folder that was installed; None if the program was installed from the
    package index (PEP 610)."""
    import importlib.metadata

    try:
        text = importlib.metadata.distribution("drivelesson").read_text("direct_url.json")
        return str(json.loads(text)["url"]) if text else None
    except (importlib.metadata.PackageNotFoundError, ValueError, KeyError, TypeError):
        return None


def _pip_install() -> str:
    """Return the pip command for the running Python, independent of the PATH."""
    import importlib.metadata

    try:
        importlib.metadata.version("pip")
    except importlib.metadata.PackageNotFoundError:
        return f"uv pip install --python {quoted(sys.executable)}"
    return f"{quoted(sys.executable)} -m pip install"


def quoted(word: str) -> str:
    """Return a word quoted for this system's shells. The word may be a command, so on Windows it
    never begins with a quote: PowerShell would print a quoted command instead of running it."""
    if os.name != "nt":
        return shlex.quote(word)
    parts = word.split("\\")
    return "\\".join(f'"{part}"' if set(part) & set(" &(),;'") else part for part in parts)
