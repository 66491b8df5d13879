"""An argument parser that suggests corrections; converters of options; a progress bar."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable
from typing import Any, NoReturn

from robot.devices import raw_value
from robot.devices.options import Option
from robot.errors import ConfigurationError, did_you_mean, need


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one sentence that names the nearest option or choice."""

    def error(self, message: str) -> NoReturn:
        text = f"{self.prog}: {message}{self._suggestion(message)}; see {self.prog} --help\n"
        self.exit(2, text)

    def _suggestion(self, message: str) -> str:
        unknown = re.match(r"unrecognized arguments: .*?(--[\w-]+)", message)
        if unknown:
            known = [flag for action in self._actions for flag in action.option_strings]
            return did_you_mean(unknown[1], known)
        choice = re.search(r"invalid choice: '([^']*)' \(choose from (.*)\)", message)
        if choice:
            return did_you_mean(choice[1], re.findall(r"[\w-]+", choice[2]))
        return ""


def number(
    *, above: float | None = None, least: float | None = None, most: float | None = None
) -> Callable[[str], Any]:
    """Return a converter for argparse (`type=`) that reads a number within these limits."""
    declared = raw_value.number(above=above, least=least, most=most)
    return lambda text: _read(float, declared, text)


def whole(
    least: int, most: int | None = None, *, or_word: str | None = None
) -> Callable[[str], Any]:
    """Return a converter for argparse that reads a whole number within limits, or one word."""
    declared = raw_value.whole(least=least, most=most, or_word=or_word)
    return lambda text: text if text == or_word else _read(int, declared, text)


def several(read: Callable[[str], Any]) -> Callable[[str], list[Any]]:
    """Return a converter for argparse that reads a comma-separated list; `read` reads an entry."""
    return lambda text: [read(part) for part in text.split(",")]


def _read(kind: type[Any], declared: Any, text: str) -> Any:
    try:
        return raw_value.reader(kind, declared)(text)
    except ConfigurationError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def declare(group: Any, option: Option) -> None:
    """Add a driver's or camera's option to the parser.

    The value is kept as text; the rig parses and checks it.
    """
    shown = "" if option.default is None else f" (default: {option.default})"
    choices = "" if option.choices is None else f": {', '.join(option.choices)}"
    text = f"{option.help}{choices}{shown}".replace("%", "%%")  # argparse expands a single %
    try:
        group.add_argument(option.flag, dest=option.name, default=None, help=text)
    except argparse.ArgumentError as error:
        raise ConfigurationError(
            f"the option {option.flag} is declared twice; the robot or camera must rename it"
        ) from error


def progress(total: int | None, unit: str, command: str, extra: str, text: str = "") -> Any:
    """Return a progress bar on standard error: a context manager with `update()`."""
    tqdm = need("tqdm", f"the command {command}", extra).tqdm
    return tqdm(total=total, unit=unit, desc=text or None, file=sys.stderr)
