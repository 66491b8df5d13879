"""Makes a time line from imperfect times: times may be missing, equal or out of order, and may
jump."""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from statistics import median

import numpy as np
from numpy.typing import NDArray

_SHORTEST_GAP_S = 1.0
_LONGEST_PAUSE_S = 60.0
"""Longest pause within a session, in seconds. A longer pause means that a new session began or that
the clock was set."""
_CUT_PAUSE_S = 2.0
"""A pause that is longer than `_LONGEST_PAUSE_S` is replaced by a pause of this length, in seconds.
The shortened pause still counts as a gap."""
_USUAL_S = 1 / 20
_SHUFFLED_STEPS, _SHUFFLED_SHARE = 3, 0.25
"""Pictures count as shuffled if at least this number, and at least this share, of the steps from
picture to picture go back in time. In consecutive sessions such steps are much rarer."""
_MOST_S = 1e11


@dataclass(frozen=True, slots=True, kw_only=True)
class Timeline:
    """Seconds since the first picture, strictly ascending, and a remark on the repairs."""

    times_s: Sequence[float]
    usual_s: float
    remark: str | None = None

    @property
    def gap_s(self) -> float:
        """The longest time between two pictures that is not a gap, in seconds. Films and datasets
        are cut at gaps."""
        return max(_SHORTEST_GAP_S, 3 * self.usual_s)

    @property
    def fps(self) -> int:
        """The usual rate in pictures per second, an integer from 1 to 60."""
        return min(max(round(1 / self.usual_s), 1), 60)

    def evenly(self, fps: int) -> list[NDArray[np.intp]]:
        """Choose `fps` pictures for each second. Return an array of indices for each stretch
        without a gap: at evenly spaced times, the nearest picture is chosen."""
        times_s = np.array(self.times_s)
        begins = [0, *(np.flatnonzero(np.diff(times_s) > self.gap_s) + 1)]
        stretches = [times_s[a:b] for a, b in pairwise([*begins, len(times_s)])]
        pairs = zip(begins, stretches, strict=True)
        return [begin + _nearest(run_s, fps) for begin, run_s in pairs if len(run_s)]


def make_timeline(stamps_s: Sequence[object]) -> Timeline:
    """Return a time for each picture.

    Stamps are in seconds, from any starting point. A value that is not a finite number counts as
    missing. A missing stamp, or a stamp out of order, is replaced by a time between its neighbours.
    Equal stamps are spread evenly over the time until the next stamp. If the spread stamps would be
    much closer together or farther apart than the drive's median period, that period is used
    instead. If the clock was set back, the time line continues after the previous picture. A pause
    of more than a minute becomes two seconds.
    """
    if isinstance(stamps_s, array) and (plain := _plain(np.array(stamps_s))) is not None:
        return plain
    read = [_seconds(stamp) for stamp in stamps_s]
    if not read:
        return Timeline(times_s=[], usual_s=_USUAL_S)
    known = [stamp for stamp in read if stamp is not None]
    if not known:
        even_s = [index * _USUAL_S for index in range(len(read))]
        remark = "no times: 20 pictures a second are assumed" if len(read) > 1 else None
        return Timeline(times_s=even_s, usual_s=_USUAL_S, remark=remark)
    filled, outliers = _filled(read, known[0])
    runs = [(stamp, len(list(same))) for stamp, same in groupby(filled)]
    usual_s = _usual(runs)
    times_s: list[float] = []
    at_s, pauses, backward = 0.0, [], 0
    for number, (stamp, count) in enumerate(runs):
        ahead_s = runs[number + 1][0] - stamp if number + 1 < len(runs) else count * usual_s
        backward += ahead_s < 0
        if ahead_s > _LONGEST_PAUSE_S:
            pauses.append(ahead_s)
            ahead_s = _CUT_PAUSE_S
        step_s = ahead_s / count
        if (count > 1 and not 0.75 * usual_s < step_s < 3 * usual_s) or step_s <= 0:
            step_s = usual_s
        times_s += [at_s + place * step_s for place in range(count)]
        at_s += max(ahead_s, count * step_s)
    equal = max(0, len(known) - outliers - len(runs))
    remark = _remark(len(read) - len(known), outliers, equal, backward, pauses)
    return Timeline(times_s=times_s, usual_s=usual_s, remark=remark)


def order_if_shuffled(stamps_s: Sequence[object]) -> list[int] | None:
    """Return the pictures' indices in the order of their stamps, if the pictures were shuffled, or
    listed from the last to the first. Return None otherwise, or if a stamp is missing."""
    known = [stamp for stamp in map(_seconds, stamps_s) if stamp is not None]
    backward = sum(after < before for before, after in pairwise(known))
    is_often = backward >= max(_SHUFFLED_STEPS, _SHUFFLED_SHARE * len(known))
    if not is_often or len(known) < len(stamps_s):
        return None
    return sorted(range(len(known)), key=known.__getitem__)


def _plain(stamps_s: NDArray[np.float64]) -> Timeline | None:
    """Return the time line of stamps that need no repair, or None. This function saves time and
    memory, because it makes no object for each stamp."""
    steps_s = np.diff(stamps_s)
    is_plain = len(steps_s) > 0 and bool(np.all((steps_s > 0) & (steps_s <= _LONGEST_PAUSE_S)))
    if not is_plain or max(-stamps_s[0], stamps_s[-1]) >= _MOST_S:
        return None
    times_s = array("d", (stamps_s - stamps_s[0]).tobytes())
    return Timeline(times_s=times_s, usual_s=float(np.median(steps_s)))


def _nearest(times_s: NDArray[np.float64], fps: int) -> NDArray[np.intp]:
    ticks_s = times_s[0] + np.arange(int((times_s[-1] - times_s[0]) * fps + 0.5) + 1) / fps
    after = np.searchsorted(times_s, ticks_s).clip(max=len(times_s) - 1)
    before = (after - 1).clip(0)
    is_before_nearer = ticks_s - times_s[before] < times_s[after] - ticks_s
    found: NDArray[np.intp] = np.where(is_before_nearer, before, after)
    return found


def _seconds(stamp: object) -> float | None:
    if isinstance(stamp, bool) or not isinstance(stamp, int | float):
        return None
    return float(stamp) if abs(stamp) < _MOST_S and math.isfinite(stamp) else None


def _filled(read: list[float | None], first_s: float) -> tuple[list[float], int]:
    """Replace each missing stamp, and each single stamp that is out of order, by the stamp before
    it."""
    filled, before_s, outliers = [], first_s, 0
    known = [index for index, stamp in enumerate(read) if stamp is not None]
    after = dict(pairwise(known))
    for index, stamp in enumerate(read):
        following = read[after[index]] if index in after else None
        if stamp is not None and following is not None and before_s <= following:
            is_outlier = index != known[0] and (stamp < before_s or stamp > following)
            outliers += is_outlier
            stamp = None if is_outlier else stamp
        before_s = before_s if stamp is None else stamp
        filled.append(before_s)
    return filled, outliers


def _usual(runs: list[tuple[float, int]]) -> float:
    """Return the usual time between two pictures, in seconds."""
    steps_s = [
        (after_s - stamp) / count
        for (stamp, count), (after_s, _) in pairwise(runs)
        for _ in range(count)
        if 0 < after_s - stamp <= _LONGEST_PAUSE_S
    ]
    return median(steps_s) if steps_s else _USUAL_S


def _remark(
    missing: int, outliers: int, equal: int, backward: int, pauses: list[float]
) -> str | None:
    longest_s = max(pauses, default=0.0)
    found = {
        f"{missing} missing": missing,
        f"{equal} equal": equal,
        f"{outliers} out of order": outliers,
        f"{backward} jumps back": backward,
        f"{len(pauses)} pauses of up to {longest_s:.0f} s shortened to {_CUT_PAUSE_S:g} s": pauses,
    }
    told = ", ".join(text for text, count in found.items() if count)
    return f"times repaired: {told}" if told else None
