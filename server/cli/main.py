"""The command line: `drivelesson COMMAND ...`; without a command it serves a robot."""

from __future__ import annotations

import argparse
import ast
import errno
import importlib.util
import sys
from collections.abc import Sequence
from functools import cache
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import robot
from robot.entry_points import points
from robot.errors import (
    ConfigurationError,
    InUseError,
    MissingExtraError,
    NotFoundError,
    PluginError,
    RecordingError,
    RobotError,
    did_you_mean,
)
from server.cli.parser import Parser

DONE, TRY_AGAIN, CHANGE_FIRST, INTERRUPTED = 0, 1, 2, 130
"""Exit statuses. 0: success. 1: the command failed, but may succeed later without changes, for
example once the camera is there or the port is free. 2: the command would fail again, until an
option, a setting, a file or a library is changed. 130: Ctrl-C ended the command."""
_LASTING = (ConfigurationError, MissingExtraError, NotFoundError, PluginError, RecordingError)

GROUP = "drivelesson.commands"
FIRST = "serve"
_DRIVE = ("drive", "run", "start", "teach")
"""Words that people try as a command in order to drive a robot; none of them is a command."""


def commands() -> dict[str, str]:
    """Return the name of each command with one line of help; the default command is first.

    A command is an entry point of `drivelesson.commands`: a module with `configure(parser)` and
    `run(args) -> int`. Its function `extend(parser, words)`, if any, declares options that depend
    on other options. The line of help is read from the module's source, because importing the
    modules of all commands would take seconds on a slow computer.
    """
    names = sorted(_points(), key=lambda name: (name != FIRST, name))
    return {name: _summary(name) for name in names}


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    words = list(sys.argv[1:] if argv is None else argv)
    if words[:1] in (["-h"], ["--help"], ["help"]):
        _print_overview()
        return 0
    if words[:1] in (["-V"], ["--version"]):
        print(f"drivelesson {robot.__version__}")
        return 0
    name = words.pop(0) if words and not words[0].startswith("-") else FIRST
    if not _points():
        print(
            f"drivelesson: not installed for {sys.executable}, which found only source files; "
            f"install it: {sys.executable} -m pip install drivelesson, or in a clone: make install",
            file=sys.stderr,
        )
        return CHANGE_FIRST
    if name not in _points():
        hint = f" (did you mean {FIRST!r}?)" if name in _DRIVE else did_you_mean(name, _points())
        print(
            f"drivelesson: unknown command {name!r}{hint}; commands: {', '.join(commands())}",
            file=sys.stderr,
        )
        return CHANGE_FIRST
    try:
        parser = make_parser(name, words)
        return int(load_command(name).run(parser.parse_args(words)))
    except BrokenPipeError:  # the reader of our output, for example `head`, has ended
        raise
    except (RobotError, OSError) as error:
        print(f"drivelesson: {error}", file=sys.stderr)
        return status_of(error)
    except KeyboardInterrupt as end:  # Ctrl-C, or SIGTERM with an exit status
        return int(end.args[0]) if end.args else INTERRUPTED


def status_of(error: RobotError | OSError) -> int:
    """Return the exit status for an error; it tells a supervisor whether a restart can help."""
    is_lasting = isinstance(error, _LASTING) and not isinstance(error, InUseError)
    is_full = getattr(error.__cause__, "errno", None) in (errno.ENOSPC, errno.EDQUOT)
    return CHANGE_FIRST if is_lasting and not is_full else TRY_AGAIN


def make_parser(
    name: str, words: Sequence[str] = (), *, is_extended: bool = True
) -> argparse.ArgumentParser:
    """Return the parser of one command. With `is_extended`, it also has the options that depend on
    the command line `words`, for example those of the chosen camera."""
    module = load_command(name)
    parser = Parser(prog=f"drivelesson {name}", description=module.__doc__)
    module.configure(parser)
    if is_extended and hasattr(module, "extend"):
        module.extend(parser, words)
    return parser


@cache
def _points() -> dict[str, EntryPoint]:
    return {point.name: point for point in points(GROUP)}


def load_command(name: str) -> Any:
    """Return the module of a command; raises KeyError if there is no command of this name."""
    return _points()[name].load()


def _summary(name: str) -> str:
    """Return the first sentence of the command's docstring, without importing the command."""
    spec = importlib.util.find_spec(_points()[name].module)
    text = Path(spec.origin).read_text("utf-8") if spec and spec.origin else ""
    docstring = ast.get_docstring(ast.parse(text)) or ""
    line = docstring.split("\n\n")[0].replace("\n", " ").split(":")[0].rstrip(".")
    return line[:1].lower() + line[1:]


def _print_overview() -> None:
    print("usage: drivelesson [COMMAND] [OPTION ...]\n\nTeach a small robot to drive by example.\n")
    for name, text in commands().items():
        print(f"  {name:12} {text}")
    print(f"\nWithout a command: {FIRST}. Options of a command: drivelesson COMMAND --help")
    print("Version: drivelesson --version")
