"""Gradient histograms in whole numbers, by look-up tables, for a brick without an FPU."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Vector
from robot.policy import image
from robot.policy.features import THUMBNAIL_HEIGHT, THUMBNAIL_WIDTH, sum_over_cells
from robot.types import Frame

Integers = NDArray[np.int64]
N_BINS = 8
_EDGES = (1, 2, 3, 4, 6, 9, 14, 21, 32, 48, 72)
"""Each gradient's magnitude is rounded to one of a few steps. The numbers are the steps' lower
bounds, in grey levels of a picture at half contrast. A smaller gradient counts as zero. Each bound
is about 1.5 times the previous bound."""
_N_STEPS = len(_EDGES) + 1
_BEYOND = 108
_SCALE = 4
_LINE, _TWO_LINES = THUMBNAIL_WIDTH, 2 * THUMBNAIL_WIDTH
_NOISE = 400
"""Number that is added to the sum of the gradients around a cell, before the cell's gradients are
divided by this sum. In plain areas the sum is small, and without `_NOISE` the division would turn
noise into strong gradients."""
_FULL = 1023
"""A bin has its largest value if it contains at least this share of the gradients of the 3x3 cells
around it, in units of 1/4096."""


class IntegerGradientFeatures:
    """Histograms of gradient orientations, and a grey picture at half contrast: 1360 bytes.

    The features resemble those of `GradientFeatures`, but take a tenth of the time on a processor
    without a floating-point unit. The gradients are computed on the small picture, in 5x4 cells of
    6x10 pixels. A pixel's two differences are the index into a table of direction and magnitude,
    and one call of `bincount` yields the histograms of all cells. Each histogram is divided by the
    sum of the histograms of the 3x3 cells around it. A second table contains the square roots of
    the results. The vector is the same on every machine.

    The histograms' bytes are multiples of 4, because `IntegerRidge` ignores the lower two bits. The
    grey picture begins with every second pixel of every second line, because only these pixels are
    used to compare pictures.
    """

    name = "integer-gradient"
    n_columns, n_rows = 4, 5
    n_gradients = n_columns * n_rows * N_BINS
    n_compared = n_gradients + THUMBNAIL_HEIGHT * THUMBNAIL_WIDTH // 4

    def extract(self, frame: Frame) -> Vector:
        """Return shape (1360,), uint8: 5x4 cells of 8 bins, then 30x40 pixels at half contrast."""
        half = _small_at_half_contrast(frame)
        picture = half.astype(np.uint8)
        even, odd = picture[::2], picture[1::2]
        parts = (self._histograms(half.ravel()), even[:, ::2], even[:, 1::2], odd)
        return np.concatenate([part.ravel() for part in parts])

    def thumbnail(self, x: Vector) -> NDArray[np.uint8]:
        doubled = np.asarray(x)[self.n_gradients :] * 2.0
        whole = doubled.round().clip(0, 255).astype(np.uint8)
        first, second = whole[:600].reshape(2, 15, 20)
        picture = np.empty((THUMBNAIL_HEIGHT, THUMBNAIL_WIDTH), np.uint8)
        picture[::2, ::2], picture[::2, 1::2] = first, second
        picture[1::2] = whole[600:].reshape(15, THUMBNAIL_WIDTH)
        return picture

    def grey(self, x: Vector) -> NDArray[np.uint8]:
        """Return every second pixel of every second line at half contrast, shape (300,)."""
        return x[self.n_gradients : self.n_compared]

    def cells(self, difference: NDArray[np.float64]) -> NDArray[np.float64]:
        bins = difference[: self.n_gradients].reshape(self.n_rows, self.n_columns, N_BINS)
        pixels = np.zeros((THUMBNAIL_HEIGHT, THUMBNAIL_WIDTH))
        compared = difference[self.n_gradients : self.n_compared]
        pixels[::2, ::2] = compared.reshape(THUMBNAIL_HEIGHT // 2, -1)
        return sum_over_cells(pixels, (bins * bins).sum(axis=2))

    def _histograms(self, half: NDArray[np.int16]) -> NDArray[np.uint8]:
        tables = _tables()
        across, down = np.zeros_like(half), np.zeros_like(half)
        # Compute on all rows as one long line, because one numpy call is faster than one for each
        # row. Gradients at the left and right edge are discarded, because they mix two rows.
        np.subtract(half[2:], half[:-2], out=across[1:-1])
        across[::THUMBNAIL_WIDTH] = across[THUMBNAIL_WIDTH - 1 :: THUMBNAIL_WIDTH] = 0
        np.subtract(half[_TWO_LINES:], half[:-_TWO_LINES], out=down[_LINE:-_LINE])
        across <<= 8
        across += down
        codes = tables.cells + tables.codes.take(across.view(np.uint16))
        counts = np.bincount(codes, minlength=self.n_gradients * _N_STEPS)
        sums = counts.reshape(-1, _N_STEPS).dot(tables.lengths)
        return self._normalised(sums.reshape(self.n_rows, self.n_columns, N_BINS)).ravel()

    def _normalised(self, cells: Integers) -> NDArray[np.uint8]:
        around = np.zeros((self.n_rows + 2, self.n_columns + 2), cells.dtype)
        around[1:-1, 1:-1] = cells.sum(axis=2)
        lines = around[:-2] + around[1:-1] + around[2:]
        sums = lines[:, :-2] + lines[:, 1:-1] + lines[:, 2:]
        sums += _NOISE
        shares = (cells << 12) // sums[:, :, None]
        histograms: NDArray[np.uint8] = _tables().roots.take(shares, mode="clip")
        return histograms


class _Tables(NamedTuple):
    """The look-up tables: 70 KB, computed once.

    The table of codes is computed with integers; with floats it would take seconds on a brick.

    Attributes:
        codes: Code of each gradient: `_N_STEPS` times the number of its direction, plus the number
            of the step of its magnitude. The index is 256 times the horizontal difference plus the
            vertical difference, as an unsigned number of 16 bits.
        cells: For each pixel, a number that is added to the pixel's code. With this number, the
            codes of different cells differ.
        lengths: For each step, a magnitude in its middle.
        roots: The value of a bin for each share from 0 to `_FULL`: the square root of the share,
            scaled to at most 252.
    """

    codes: NDArray[np.uint8]
    cells: NDArray[np.int16]
    lengths: NDArray[np.intp]
    roots: NDArray[np.uint8]


@lru_cache(maxsize=1)
def _tables() -> _Tables:
    codes = np.zeros(1 << 16, np.uint8)
    edges = np.array(_EDGES, np.int32) ** 2
    down = np.arange(-127, 128, dtype=np.int32)
    for across in range(-127, 128):  # process the rows one by one, to save memory
        step = np.searchsorted(edges, across * across + down * down, side="right")
        index = ((across << 8) + down).astype(np.int16).view(np.uint16)
        codes[index] = _direction(across, down) * _N_STEPS + step
    of = IntegerGradientFeatures
    rows = np.arange(THUMBNAIL_HEIGHT) * of.n_rows // THUMBNAIL_HEIGHT
    columns = np.arange(THUMBNAIL_WIDTH) * of.n_columns // THUMBNAIL_WIDTH
    cells = (rows[:, None] * of.n_columns + columns).ravel() * (N_BINS * _N_STEPS)
    middles = [round(_SCALE * (a * b) ** 0.5) for a, b in pairwise((*_EDGES, _BEYOND))]
    roots = [4 * round(63 * (share / _FULL) ** 0.5) for share in range(_FULL + 1)]
    return _Tables(
        codes,
        cells.astype(np.int16),
        np.array([0, *middles], np.intp),
        np.array(roots, np.uint8),
    )


def _direction(across: int, down: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the nearest of 8 directions: 0 is right, 2 down, 4 left and 6 up. Odd numbers are the
    diagonals."""
    width, height = abs(across), np.abs(down)
    # tan 22.5 degrees is about 12 / 29
    is_level, is_upright = 29 * height <= 12 * width, 29 * width <= 12 * height
    right_or_left = 0 if across > 0 else 4
    down_or_up = np.where(down > 0, 2, 6)
    between = np.where(down > 0, 1 if across > 0 else 3, 7 if across > 0 else 5)
    upright = np.where(is_upright, down_or_up, between)
    return np.where(is_level, right_or_left, upright).astype(np.int32)


def _small_at_half_contrast(frame: Frame) -> NDArray[np.int16]:
    """Return 40x30 grey values from 0 to 127, shape (30, 40).

    In a picture of 160x120, the middle four pixels of each 4x4 block are averaged. Averaging all
    sixteen pixels would take four times as long, with no better results
    (docs/explanation/learner.md). In pictures of other sizes, whole areas are averaged.
    """
    grey = image.to_grey(frame)
    if grey.shape != (4 * THUMBNAIL_HEIGHT, 4 * THUMBNAIL_WIDTH):
        return image.shrink(grey, THUMBNAIL_WIDTH, THUMBNAIL_HEIGHT).astype(np.int16) >> 1
    sums = grey[1::4, 1::4].astype(np.int16)
    for others in (grey[1::4, 2::4], grey[2::4, 1::4], grey[2::4, 2::4]):
        sums += others
    sums >>= 3
    return sums
