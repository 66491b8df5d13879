"""Reads times in other programs' formats: numbers in any unit, dates, and times in file names."""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Iterable
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from itertools import pairwise
from statistics import median

_UNITS = {"ns": 1e-9, "nsec": 1e-9, "us": 1e-6, "ms": 1e-3, "msec": 1e-3, "s": 1.0, "sec": 1.0}
_UNIT = re.compile(r"(?:^|[\W_])(ns|nsec|us|ms|msec|milliseconds)(?:$|[\W_])")
_SECONDS = re.compile(r"(?:^|[\W_])(s|sec|seconds)(?:$|[\W_])")
_DIGITS = re.compile(r"(?<!\d)(1\d{9})(\d{0,9})(?:[._](\d{1,9}))?(?!\d)")
_DATE = re.compile(
    r"(?<!\d)(20\d\d)[-_]?([01]\d)[-_]?([0-3]\d)[-_ T]?([0-2]\d)[-_:]?([0-5]\d)[-_:]?([0-5]\d)"
    r"(?:[-_.](\d{1,9}))?(?!\d)"
)
_WRITTEN = re.compile(
    r"(\d{1,2}|\d{4})([./-])(\d{1,2})\2(\d{1,4})[ T,]+(\d{1,2}):(\d\d)"
    r"(?::(\d\d)(?:[.,:](\d{1,9}))?)? ?(?:([APap])\.?[Mm]\.?)?"
)
_CLOCK = re.compile(r"(?:(\d{1,3}):)?(\d{1,2}):(\d\d)(?:[.,](\d{1,9}))?")
_SINCE_1970 = {1e17: 1e-9, 1e14: 1e-6, 1e11: 1e-3}
"""Bounds with factors. A number above the first bound is a time since 1970 in nanoseconds; above
the second, in microseconds; above the third, in milliseconds. Multiplying it by the bound's factor
gives seconds."""
_FIRST_S, _LAST_S = 1e9, 4e9
"""Bounds of times since 1970 in seconds: the years 2001 and 2096."""
_LONGEST_STEP_S, _LONGEST_PAUSE_S = 5.0, 3600.0
"""Largest plausible times between two pictures, in seconds: in a drive, and in pictures that a
person took one by one. The second bound applies only to times since 1970, whose unit is known."""


def seconds_of(value: object, name: str = "") -> float | None:
    """Return a time in seconds; None if `value` is not a time.

    A date without a time zone is read as UTC. Only differences between times are used, and UTC has
    no daylight saving time, which would change some of them. `name` is the time's name, which may
    contain a unit, as in `timestamp[ns]`.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        if "_" in str(value):  # float() would ignore the `_`, and read a date as a number
            return _date_of(str(value))
        number = float(value)
    except (ValueError, OverflowError):
        return _date_of(str(value))
    if not math.isfinite(number):
        return None
    unit = _UNIT.search(name.lower())
    if unit:
        return number * _UNITS.get(unit[1], 1e-3)
    return number * _factor(number)


def date_or_zero(at_s: object) -> float:
    """Return a time in seconds if it is a date of the years 2001 to 2096; otherwise return 0."""
    if isinstance(at_s, int | float) and _FIRST_S < at_s < _LAST_S:
        return float(at_s)
    return 0.0


def unit_of(texts: Iterable[str], name: str) -> float | None:
    """Return the unit of a table's times, in seconds; None if `seconds_of` reads the times
    correctly.

    Many programs write the milliseconds since their start as `timestamp`. If neither the numbers
    (times since 1970) nor their name show the unit, the unit is chosen so that the usual time
    between two pictures is less than 5 s.
    """
    numbers = []
    for text in texts:
        with contextlib.suppress(ValueError):
            numbers.append(float(text))
    steps = [abs(after - before) for before, after in pairwise(numbers) if after != before]
    is_stated = (_UNIT.search(name.lower()) or _SECONDS.search(name.lower())) is not None
    if is_stated or not steps:
        return None
    assumed, usual = _factor(numbers[0]), median(steps)
    is_since_1970 = _FIRST_S < numbers[0] * assumed < _LAST_S
    if usual * assumed < (_LONGEST_PAUSE_S if is_since_1970 else _LONGEST_STEP_S):
        return None
    units = (unit for unit in (1e-3, 1e-6, 1e-9) if unit < assumed)
    return next((unit for unit in units if usual * unit < _LONGEST_STEP_S), None)


def _factor(number: float) -> float:
    return next((share for least, share in _SINCE_1970.items() if abs(number) > least), 1.0)


def _date_of(text: str) -> float | None:
    text = text.strip()
    date = None
    for read in (datetime.fromisoformat, parsedate_to_datetime, _asctime, _written):
        with contextlib.suppress(ValueError, OverflowError):
            date = date or read(text)
    if date is None:
        on_clock = _on_clock(text)
        return seconds_in_name(f"{text}.") if on_clock is None else on_clock
    return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()


def _asctime(text: str) -> datetime:
    return datetime.strptime(text, "%a %b %d %H:%M:%S %Y")


def _written(text: str) -> datetime | None:
    """Read a date of digits. In a date with slashes the first number is the month, unless it is too
    large for a month. Only the differences between times are used. If day and month are in the
    wrong order, the differences within one day are still right."""
    found = _WRITTEN.fullmatch(text)
    if found is None:
        return None
    first, mark, second, third, hour, minute, second_s, fraction, half = found.groups()
    year, month, day = int(third), int(first), int(second)
    if len(first) == 4:
        year, month, day = int(first), int(second), int(third)
    elif mark == "." or month > 12:
        month, day = day, month
    hours = int(hour) % 12 + 12 * (half.lower() == "p") if half else int(hour)
    micros = int((fraction or "0").ljust(6, "0")[:6])
    year += 2000 * (year < 100)
    return datetime(year, month, day, hours, int(minute), int(second_s or 0), micros, tzinfo=UTC)


def _on_clock(text: str) -> float | None:
    """Read a time of day, or a time since the start: `22:13:20`, `0:00:05.25` or `03:20.5`."""
    found = _CLOCK.fullmatch(text)
    if found is None or (found[1] is None and found[4] is None):
        return None  # without a fraction, `22:13` may be hours and minutes
    hours, minutes, seconds, fraction = found.groups()
    whole_s = 3600 * int(hours or 0) + 60 * int(minutes) + int(seconds)
    return whole_s + float(f"0.{fraction or 0}")


def seconds_in_name(name: str) -> float | None:
    """Return the time in a picture's name; None if the name contains no time.

    Two forms of a time are recognised: ten digits of seconds since 1970, which may be followed by
    the digits of a fraction; and a date with a time of day.
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
