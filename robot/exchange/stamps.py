"""Reads times in other programs' formats: numbers in any unit, dates, digits in pictures' names."""

from __future__ import annotations

import contextlib
import math
import re
from datetime import UTC, datetime

_UNITS = {"ns": 1e-9, "nsec": 1e-9, "us": 1e-6, "ms": 1e-3, "msec": 1e-3, "s": 1.0, "sec": 1.0}
_UNIT = re.compile(r"(?:^|[\W_])(ns|nsec|us|ms|msec|milliseconds)(?:$|[\W_])")
_DIGITS = re.compile(r"(?<!\d)(1\d{9})(\d{0,9})(?:[._](\d{1,9}))?(?!\d)")
_DATE = re.compile(
    r"(?<!\d)(20\d\d)[-_]?([01]\d)[-_]?([0-3]\d)[-_ T]?([0-2]\d)[-_:]?([0-5]\d)[-_:]?([0-5]\d)"
    r"(?:[-_.](\d{1,9}))?(?!\d)"
)
_SINCE_1970 = {1e17: 1e-9, 1e14: 1e-6, 1e11: 1e-3}
"""Lower bounds of numbers that are nanoseconds, microseconds and milliseconds since 1970, with
their factors to seconds."""


def seconds_of(value: object, name: str = "") -> float | None:
    """Return a time in seconds; None if `value` is not a time.

    A date without a time zone counts as UTC: only differences matter, and daylight saving time
    would break them. `name` is the time's name, which may contain a unit, as in `timestamp[ns]`.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        number = float(value)
    except (ValueError, OverflowError):
        return _date_of(str(value))
    if not math.isfinite(number):
        return None
    unit = _UNIT.search(name.lower())
    if unit:
        return number * _UNITS.get(unit[1], 1e-3)
    return number * next((share for least, share in _SINCE_1970.items() if abs(number) > least), 1)


def _date_of(text: str) -> float | None:
    with contextlib.suppress(ValueError):
        date = datetime.fromisoformat(text.strip())
        return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()
    return None


def seconds_in_name(name: str) -> float | None:
    """Return the time in a picture's name; None if the name contains no time.

    A time is ten digits of seconds since 1970, followed by the fraction, whose last zeros may be
    missing; or a date and a time of day.
    """
    stem = re.split(r"[\\/]", name)[-1].rpartition(".")[0]
    if found := _DIGITS.search(stem):
        return float(f"{found[1]}.{found[2] or found[3] or 0}")
    if found := _DATE.search(stem):
        *date, fraction = found.groups()
        with contextlib.suppress(ValueError):
            begin = datetime(*map(int, date), tzinfo=UTC).timestamp()  # type: ignore[arg-type,misc]
            return begin + float(f"0.{fraction or 0}")
    return None
