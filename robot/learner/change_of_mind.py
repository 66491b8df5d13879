"""Notices that the pilot has changed his mind: the same view is labelled anew, again and again.

A label that is no longer used is no evidence: a pilot who turns round and drives the other way has
not changed his mind about the way there. One contradiction is none either: between a turn and
driving on the same view means both. So each image counts the examples of its own view, no farther
from it than views of one place usually are, that have got another label since it was last
confirmed. An image with enough of them passes most of its label's votes on to the new label; where
many images of a label do, all of them do. That is read when votes are counted: no histogram is
changed, and the old label used there once more takes it all back.

The label that is taken up most often, such as FORWARD, is left out: it follows every other, and
where is a matter of a tenth of a second.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot.learner.votes import Distances, Floats

FEW, ENOUGH = 4, 12
"""As many examples of its view as it sums up itself overrule an image, within these bounds,"""
MANY = 0.4
"""and such a share of a label's images all of them."""
STILL_VALID = 0.3
"""Share of the old label's votes that are left then."""


class ChangeOfMind:
    """Counts for each image how often its view was labelled anew; labels are columns 0, 1, ...

    Args:
        max_nodes: How many images there are at most.
    """

    def __init__(self, max_nodes: int) -> None:
        self._anew = np.zeros((max_nodes, 0), np.int64)
        self._starts = np.zeros(0, np.int64)
        self._last = -1

    def add_label(self) -> None:
        """Make room for one more label."""
        self._anew = np.pad(self._anew, ((0, 0), (0, 1)))
        self._starts = np.append(self._starts, 0)

    def note(
        self, label: int, distances: Distances, histograms: NDArray[np.int64], reach: float
    ) -> None:
        """Process one example.

        Args:
            label: Its label.
            distances: Its squared distances to the images, shape (n,).
            histograms: Labels counted per image, shape (n, n_labels).
            reach: Squared distance up to which it is an image's own view.
        """
        self._starts[label] += label != self._last
        self._last = label
        if not distances.size or not reach:
            return
        own = histograms.argmax(axis=1)
        near, usual = distances <= reach, int(self._starts.argmax())
        self._anew[: len(own)][near & (own == label)] = 0
        if label != usual:
            self._anew[: len(own), label] += near & (own != label) & (own != usual)

    def follow(self, kept: int, removed: int) -> None:
        """Take the counts of a merged image over."""
        np.maximum(self._anew[kept], self._anew[removed], out=self._anew[kept])
        self._anew[removed] = 0

    def move(self, source: int, target: int) -> None:
        """Let one image take the place of another, which is gone."""
        self._anew[target] = self._anew[source]
        self._anew[source] = 0

    def forget(self, node: int) -> None:
        """Forget what speaks against an image: a person edited it."""
        self._anew[node] = 0

    def applied(
        self, shares: Floats, distances: Distances, histograms: NDArray[np.int64]
    ) -> Floats:
        """Return the shares after what was labelled anew near a view.

        Args:
            shares: Of each label, shape (n_labels,).
            distances: Squared distances to the images, shape (n,).
            histograms: Labels counted per image, shape (n, n_labels).
        """
        anew = self._anew[: len(histograms)]
        enough = histograms.max(axis=1).clip(FEW, ENOUGH)
        is_overruled = anew.max(axis=1, initial=0) >= enough
        if not is_overruled.any():
            return shares
        own, to, shares = histograms.argmax(axis=1), anew.argmax(axis=1), shares.copy()
        for old in np.unique(own[is_overruled]).tolist():
            images = np.flatnonzero(own == old)
            nearest = int(images[distances[images].argmin()])
            news = to[images[is_overruled[images]]]
            if len(news) >= MANY * len(images):
                new = int(np.bincount(news).argmax())
            elif is_overruled[nearest]:
                new = int(to[nearest])
            else:
                continue
            passed = (1.0 - STILL_VALID) * shares[old]
            shares[old] -= passed
            shares[new] += passed
        return shares

    def get_arrays(self) -> dict[str, NDArray[np.int64]]:
        """Return copies of all that is kept."""
        starts = np.append(self._starts, self._last + 1)  # 0: none
        return {"anew": self._anew.copy(), "starts": starts}

    def set_arrays(self, arrays: dict[str, NDArray[np.int64]], n_labels: int) -> None:
        """Restore what `get_arrays` returned; older models have none of it."""
        none = np.zeros((len(self._anew), n_labels), np.int64)
        self._anew = arrays.get("anew", none).copy()
        starts = arrays.get("starts", np.zeros(n_labels + 1, np.int64))
        self._starts, self._last = starts[:-1].copy(), int(starts[-1]) - 1
