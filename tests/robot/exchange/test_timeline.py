"""Whatever the times are, every picture is kept, and is shown for its original duration."""

from __future__ import annotations

import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.exchange.stamps import seconds_of, unit_of
from robot.exchange.timeline import make_timeline

EVEN = [index / 20 for index in range(60)]
STAMPS = st.none() | st.floats() | st.integers() | st.booleans() | st.text(max_size=2)


def after(place: int, shift_s: float) -> list[float]:
    return EVEN[:place] + [at_s + shift_s for at_s in EVEN[place:]]


CASES: dict[str, tuple[list[float], int]] = {
    "even": (EVEN, 1),
    "all equal": ([7.0] * 60, 1),
    "whole seconds": ([float(int(at_s)) for at_s in EVEN], 1),
    "in pairs": ([EVEN[index // 2 * 2] for index in range(60)], 1),
    "one equal": ([*EVEN[:20], EVEN[19], *EVEN[21:]], 1),
    "an hour on": (after(30, 3600.0), 2),
    "an hour back": (after(30, -3600.0), 1),
    "a year on": (after(30, 365 * 86400.0), 2),
    "half a second back": (after(30, -0.5), 1),
    "one stamp of a year on": ([*EVEN[:30], 3e7, *EVEN[31:]], 1),
    "backward": (EVEN[::-1], 1),
    "five seconds without pictures": (after(30, 5.0), 2),
    "slow": ([2.0 * index for index in range(20)], 1),
}


@given(st.lists(STAMPS, max_size=50))
def test_any_time_stamps_are_repaired_to_ascending_ones(stamps: list[object]) -> None:
    line = make_timeline(stamps)
    assert len(line.times_s) == len(stamps)
    assert all(b > a for a, b in zip(line.times_s, line.times_s[1:], strict=False))
    shown = [index for stretch in line.evenly(line.fps) for index in stretch]
    assert shown == sorted(shown) and bool(shown) is bool(stamps)
    assert not stamps or (line.times_s[0] == 0.0 and line.times_s[-1] <= 61 * len(stamps))


def test_ascending_time_stamps_are_not_changed() -> None:
    dice = random.Random(1)
    times_s = [0.0]
    for _ in range(500):
        times_s.append(times_s[-1] + dice.choice([0.02, 0.05, 0.3, 7.0, 59.0]))
    line = make_timeline([1.6e9 + at_s for at_s in times_s])
    assert line.times_s == pytest.approx(times_s, abs=1e-3) and line.remark is None


@pytest.mark.parametrize("name", CASES)
def test_every_picture_is_shown_for_as_long_as_it_was_there(name: str) -> None:
    """A dataset has 20 pictures a second, and long pauses split a drive."""
    times_s, n_parts = CASES[name]
    line = make_timeline(times_s)
    stretches = line.evenly(20)
    shown = np.concatenate(stretches)
    assert len(stretches) == n_parts
    assert len(shown) == (20 * 2 * (len(times_s) - 1) + 1 if name == "slow" else len(times_s))
    assert np.abs(np.unique(shown)[:, None] - np.arange(len(times_s))).min(axis=0).max() <= 1
    is_as_it_was = name in ("even", "slow", "five seconds without pictures")
    assert (line.remark is None) is is_as_it_was


@pytest.mark.parametrize(
    "text",
    [
        *("2019-04-05 20:43:31.162168", "2019-04-05T20:43:31.162168Z", "20190405T204331.162168"),
        *("2019-04-05 22:43:31.162168+02:00", "2019/04/05 20:43:31.162168"),
        *("04/05/2019 20:43:31.162168", "4/5/2019, 8:43:31.162168 PM", "4/5/19 08:43:31.162168 pm"),
        *("05.04.2019 20:43:31,162168", "2019_04_05_20_43_31_162168", "1554497011.162168"),
        *("1554497011162.168", " 2019-04-05 20:43:31.162168\n", "05-04-2019 20:43:31.162168"),
        *("Fri Apr  5 20:43:31 2019", "Fri, 05 Apr 2019 20:43:31 GMT"),
    ],
)
def test_a_written_time_is_read(text: str) -> None:
    seconds = seconds_of(text)
    assert seconds is not None
    apart_s = abs(seconds - 1554497011.162168)
    is_exact = apart_s < (1e-3 if "162" in text else 0.2)
    assert is_exact or apart_s == pytest.approx(29 * 86400), "day and month may be swapped"


def test_other_texts_are_not_read_as_times() -> None:
    for text in ("", "soon", "left", "12:30", "99/99/2019 20:43", "1.2.3.4", "0x10"):
        assert seconds_of(text) is None, text


@pytest.mark.parametrize(
    ("name", "begin", "step", "unit"),
    [
        *(("timestamp", 0, 0.05 / unit, unit) for unit in (1e-3, 1e-6, 1e-9)),
        ("time", 3.6e12, 5e7, 1e-9),  # one hour after the computer was switched on
        ("t", 0, 200, 1e-3),
        *(("timestamp", begin, 20, None) for begin in (1.6e9, 1.6e12, 1.6e15)),
        *((name, 0, 20, None) for name in ("time_s", "seconds", "time_ms", "timestamp[ns]")),
        *(("timestamp", 0, step, None) for step in (0.0, 0.05, 4.0)),
    ],
)
def test_the_unit_of_a_tables_times_follows_from_their_size(
    name: str, begin: float, step: float, unit: float | None
) -> None:
    """If neither name nor year tells the unit, pictures are assumed to be at most 5 s apart."""
    assert unit_of([str(begin + n * step) for n in range(9)] + ["", "noon"], name) == unit
