"""Detects that the pilot has changed his mind and relabels the same views again and again.

A label that is no longer used is no evidence: a pilot who turns round and drives back has not
changed his mind about the way there. A single contradiction is no evidence either: at the beginning
of a turn the same view can have the labels of the turn and of driving straight. So an example
contradicts another label only if it is clearly nearer to that label's images than to the images of
driving straight, and its own label's images are no nearer. After a change of mind most examples
contradict the old label; in a lesson in the opposite direction few do.

A label that was contradicted often enough loses most of its votes at a view in two cases: its image
nearest to the view was last taught before the contradictions began; or another label's image is at
least as near and was taught much later. Both rules apply only when votes are counted and change no
histogram. So the rules' effect ends if the old label is taught again at such views.

The pilot can also declare a change of mind (`outdate`), which is better evidence. A label whose
nearest image was taught before the declaration passes its votes to the nearest image taught since.

The label that is started most often, such as FORWARD, is left out: it follows every other label,
and the tenth of a second in which it begins varies.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from robot.learner.part import Array, Stateful, Value
from robot.learner.values import WHOLE, count
from robot.learner.votes import Distances, Floats

CLEARLY = 0.9
"""An image is clearly nearer than another if its distance is at most this share of the other's."""
APART = 1.3
"""An example's label differs clearly from another label if the other label's images are at least
this many times as far away as the images of its own label."""
ENOUGH = 20.0
"""Number of examples that overrule a label: examples against it, less examples that confirm it."""
MOST_A_TURN = 10.0
"""A single turn adds at most this many examples against a label, because it may be a mistake."""
CONFIRMED = 4.0
"""One example of the label at its old views cancels this many examples against the label."""
LATER = 200
"""An image counts as taught much later than another after this many examples (20 s of teaching)."""
STILL_VALID = 0.3
"""Share of an overruled label's votes that remains."""


class ChangeOfMind(Stateful):
    """Weighs for each pair of labels whether the second has replaced the first.

    Labels are columns 0, 1, ...; times are counts of examples. Arrays of shape (n,) describe the
    images: `distances` are squared, `owners` are the labels that the images vote for most (-1:
    none), and `taught` is the time at which each image last got an example.
    """

    fields = (
        Array("contradicted", np.float64, ("n_labels+1", "n_labels")),
        Array("contradicted_since", np.int64, ("n_labels", "n_labels"), 0, WHOLE, "_since"),
        Array("taken_up", np.int64, ("n_labels+1",), 0, WHOLE, "_kept_taken_up"),
        Value("outdated_before", count()),
    )

    def __init__(self) -> None:
        self._against = np.zeros((0, 0))  # examples by which the second label contradicts the first
        self._since = np.zeros((0, 0), np.int64)
        self._taken_up = np.zeros(0, np.int64)
        self._last = -1
        self._outdated_before = 0
        self._before = np.zeros(0)  # evidence against each label at the start of this turn

    def add_label(self) -> None:
        """Make room for one more label."""
        self._against = np.pad(self._against, (0, 1))
        self._since = np.pad(self._since, (0, 1))
        self._taken_up = np.append(self._taken_up, 0)
        self._before = np.append(self._before, 0.0)

    def note(
        self,
        label: int,
        distances: Distances,
        owners: NDArray[np.int64],
        taught: NDArray[np.int64],
        now: int,
    ) -> None:
        """Process one example, taught at time `now`."""
        if label != self._last:
            self._taken_up[label] += 1
            self._before, self._last = self._against[:, label].copy(), label
        usual = int(self._taken_up.argmax())
        if label == usual:
            return
        near = distances < CLEARLY**2 * distances[owners == usual].min(initial=np.inf)
        apart = APART**2 * distances[owners == label].min(initial=np.inf)
        others = [other for other in range(len(self._taken_up)) if other not in (label, usual)]
        for old in others:
            if not self._against[old, label]:
                self._since[old, label] = now
            images = near & (distances < apart)
            images &= (owners == old) & (taught < self._since[old, label])
            most = min(self._before[old] + MOST_A_TURN, 2 * ENOUGH)
            now_against = self._against[old, label] + (1.0 if images.any() else -1.0)
            self._against[old, label] = min(max(now_against, 0.0), most)
        for new in others:
            if (near & (owners == label) & (taught < self._since[label, new])).any():
                self._against[label, new] = max(self._against[label, new] - CONFIRMED, 0.0)

    def outdate(self, now: int) -> None:
        """Give the examples from `now` on more weight than all earlier examples."""
        self._outdated_before = now

    def applied(
        self,
        shares: Floats,
        distances: Distances,
        owners: NDArray[np.int64],
        taught: NDArray[np.int64],
    ) -> Floats:
        """Return the labels' shares of a view, shape (n_labels,), corrected for relabelling."""
        usual = int(self._taken_up.argmax())
        nearest: dict[int, tuple[float, int]] = {}  # for each label: (distance, time taught)
        for label in range(len(shares)):
            if label != usual:
                image = int(np.where(owners == label, distances, np.inf).argmin())
                if owners[image] == label:
                    nearest[label] = float(distances[image]), int(taught[image])
        if len(nearest) < 2:
            return shares
        after = shares.copy()
        for old, (distance, old_s) in nearest.items():
            followers = [
                (other, new)
                for new, (other, new_s) in nearest.items()
                if (self._against[old, new] >= ENOUGH and old_s < self._since[old, new])
                or old_s < self._outdated_before <= new_s
                or (other <= distance and new_s > old_s + LATER)
            ]
            if followers:
                passed = (1.0 - STILL_VALID) * shares[old]
                after[old] -= passed
                after[min(followers)[1]] += passed
        return after

    @property
    def _contradicted(self) -> Floats:
        """The evidence against each label; the last row is from the start of this turn."""
        return np.vstack([self._against, self._before])

    @_contradicted.setter
    def _contradicted(self, against: Floats) -> None:
        self._against, self._before = against[:-1], against[-1]

    @property
    def _kept_taken_up(self) -> NDArray[np.int64]:
        """How often each label was started, and the last label; 0 if there is none."""
        return np.append(self._taken_up, self._last + 1)

    @_kept_taken_up.setter
    def _kept_taken_up(self, taken_up: NDArray[np.int64]) -> None:
        self._taken_up, self._last = taken_up[:-1], int(taken_up[-1]) - 1

    def faults(self) -> Iterator[str]:
        if self._last >= len(self._taken_up):
            yield "the last label does not exist"
