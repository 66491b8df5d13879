"""A parser that suggests what was meant, and values that are checked where they are read."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from typing import NoReturn

from robot.errors import did_you_mean

_LABEL = re.compile(r"[a-z0-9]([a-z0-9-]{0,61}[a-z0-9])?", re.IGNORECASE)


class Parser(argparse.ArgumentParser):
    """Names the nearest known option or choice when one is misspelt."""

    def error(self, message: str) -> NoReturn:
        """Print usage, message and suggestion; exit with 2."""
        super().error(message + self._suggestion(message))

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
) -> Callable[[str], float]:
    """Return argparse's reader of a number within limits: more than `above`, from `least`."""

    def read(text: str) -> float:
        wanted = _range("number", above, least, most)
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        is_good = (
            value - value == 0  # neither infinite nor NaN
            and (above is None or value > above)
            and (least is None or value >= least)
            and (most is None or value <= most)
        )
        if not is_good:
            raise argparse.ArgumentTypeError(f"must be {wanted}, not {text!r}")
        return value

    return read


def whole(
    least: int, most: int | None = None, *, or_word: str | None = None
) -> Callable[[str], int | str]:
    """Return argparse's reader of a whole number within limits, or of one word."""

    def read(text: str) -> int | str:
        if or_word is not None and text == or_word:
            return text
        wanted = _range("whole number", None, least, most)
        try:
            value = int(text)
        except ValueError:
            value = least - 1
        if value < least or (most is not None and value > most):
            suffix = f", or {or_word!r}" if or_word else ""
            raise argparse.ArgumentTypeError(f"must be {wanted}{suffix}, not {text!r}")
        return value

    return read


def host_name(text: str) -> str:
    """Read the first part of a name on the local network, as argparse's `type`."""
    if not _LABEL.fullmatch(text):
        raise argparse.ArgumentTypeError(
            f"must be letters, digits and hyphens, at most 63 and none of them a dot, not {text!r}"
        )
    return text


def _range(kind: str, above: float | None, least: float | None, most: float | None) -> str:
    if above is not None:
        kind += f" above {above:g}"
    elif least is not None:
        kind += f" from {least:g}" if most is not None else f" of at least {least:g}"
    if most is not None:
        kind += f" up to {most:g}" if above is not None or least is None else f" to {most:g}"
    return f"a {kind}"
