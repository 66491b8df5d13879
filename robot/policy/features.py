"""Converts a frame to the vector that a learner compares: a small grey picture, and histograms of
gradient orientations."""

from __future__ import annotations

from functools import cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Vector
from robot.policy import image
from robot.types import Frame

Singles = NDArray[np.float32]
THUMBNAIL_WIDTH, THUMBNAIL_HEIGHT = 40, 30
"""Size of the paper's picture: a quarter of 160x120 in each direction."""
COMMON_SIDES = 4 * THUMBNAIL_WIDTH, 4 * THUMBNAIL_HEIGHT
CELL_COLUMNS, CELL_ROWS = 8, 6
"""Number of cells across and down a picture. The page shows how alike two views are in each
cell."""


class Features(Protocol):
    """Pure functions from a frame to a vector, and from a vector to a thumbnail."""

    name: str

    def extract(self, frame: Frame) -> Vector:
        """Return the vector, shape (d,). Raises CameraError for bytes that are not an image."""
        ...

    def thumbnail(self, x: Vector) -> NDArray[np.uint8]:
        """Return the picture of a vector, such as a node's, shape (30, 40) or (30, 40, 3)."""
        ...

    def grey(self, x: Vector) -> NDArray[np.uint8]:
        """Return the vector's grey values, shape (n,); contrast and resolution may be reduced."""
        ...

    def cells(self, difference: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the contribution of each cell to a squared distance, shape (6, 8)."""
        ...


class PictureFeatures:
    """Base class of features whose vectors end with a grey picture of 40x30 pixels.

    Attributes:
        n_others: Number of values before the picture.
        contrast: Divisor of the picture's grey values.
    """

    n_others, contrast = 0, 1

    def thumbnail(self, x: Vector) -> NDArray[np.uint8]:
        pixels = np.asarray(x)[self.n_others :] * float(self.contrast) + (self.contrast - 1) // 2
        whole = pixels.round().clip(0, 255).astype(np.uint8)
        return whole.reshape(THUMBNAIL_HEIGHT, THUMBNAIL_WIDTH)

    def grey(self, x: Vector) -> NDArray[np.uint8]:
        return x[self.n_others :]

    def brightened(self, x: Vector, gain: float) -> Vector:
        """Return a copy of a vector with its grey values multiplied by `gain`, at most white."""
        brighter = x.copy()
        brighter[self.n_others :] = np.minimum(self.grey(x) * gain, 255 // self.contrast)
        return brighter


class GreyFeatures(PictureFeatures):
    """A grey picture of 40x30 pixels, each the average of an area of the frame: 1200 bytes."""

    name = "grey"

    def extract(self, frame: Frame) -> Vector:
        """Return shape (1200,), uint8."""
        return image.to_small_grey(frame, THUMBNAIL_WIDTH, THUMBNAIL_HEIGHT).ravel()

    def cells(self, difference: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the sums of squares over cells of 5x5 pixels, shape (6, 8)."""
        return sum_over_cells(difference)


class GradientFeatures(PictureFeatures):
    """Histograms of gradient orientations, and a grey picture at half contrast: 1584 bytes.

    A simplified HOG (Dalal and Triggs, 2005): 8x6 cells with 8 bins for signed directions. Each
    value is divided by the L2 norm of the 3x3 cells around it, and its square root is stored. Each
    gradient is shared between two neighbouring directions. If max and min are the magnitudes of a
    gradient's two components, the nearest axis gets max - min, and the nearest diagonal gets min.
    So no pixel needs an arctangent or a square root. The code computes the eight directions from
    the sums of eight simpler parts. The grey part distinguishes plain surfaces. It is also a node's
    thumbnail.
    """

    name = "gradient"
    n_columns, n_rows, n_bins = CELL_COLUMNS, CELL_ROWS, 8
    n_gradients = n_others = n_columns * n_rows * n_bins
    contrast = 2
    samples = 10
    """Each cell has 10x10 sample points: every second pixel of a picture of 160x120. Larger
    pictures are first reduced to this size, so vectors do not depend on the camera's resolution."""
    reach, shared = (2.0, 1.0), 0.7
    """Prior correlation of the linear part's weights in neighbouring cells: its range in cells
    (horizontal and vertical), and the correlated share of a weight."""
    noise = 100.0
    """Sum of gradients that counts as noise: one grey level at each of a cell's 100 samples."""

    def extract(self, frame: Frame) -> Vector:
        """Return shape (1584,), uint8: 6x8x8 gradient bins, then 30x40 grey values, halved."""
        grey = image.at_common_scale(image.to_grey(frame), *COMMON_SIDES)
        small = image.shrink(grey, THUMBNAIL_WIDTH, THUMBNAIL_HEIGHT)
        return np.concatenate([self._histograms(grey), small.ravel() >> 1])

    @classmethod
    @cache
    def mirror(cls) -> NDArray[np.intp]:
        """For each gradient value, return the index of its mirrored value, shape (384,).

        Mirroring reverses the order of the columns of cells, and swaps left and right directions.
        """
        places = np.arange(cls.n_gradients).reshape(cls.n_rows, cls.n_columns, cls.n_bins)
        return places[:, ::-1, (cls.n_bins // 2 - np.arange(cls.n_bins)) % cls.n_bins].ravel()

    @classmethod
    @cache
    def alike(cls) -> NDArray[np.float64]:
        """Return the prior covariance of the linear part's weights, shape (384, 384).

        The correct move hardly depends on whether an edge lies in one cell or in the next. So the
        weights of one direction are similar in nearby cells. An example then also teaches slightly
        shifted views. Training on shifted copies instead would take twice as long.
        """
        near = [
            np.exp(-0.5 * ((np.arange(n)[:, None] - np.arange(n)) / reach) ** 2)
            for n, reach in ((cls.n_rows, cls.reach[1]), (cls.n_columns, cls.reach[0]))
        ]
        cells = np.kron(np.kron(near[0], near[1]), np.eye(cls.n_bins))
        alike: NDArray[np.float64] = cls.shared * cells + (1.0 - cls.shared) * np.eye(len(cells))
        return alike

    def cells(self, difference: NDArray[np.float64]) -> NDArray[np.float64]:
        """For each cell, return the sum of squares of its gradients and pixels, shape (6, 8)."""
        bins = difference[: self.n_gradients].reshape(self.n_rows, self.n_columns, self.n_bins)
        cells: NDArray[np.float64] = (bins * bins).sum(axis=2)
        return cells + sum_over_cells(difference[self.n_gradients :])

    def _histograms(self, grey: NDArray[np.uint8]) -> NDArray[np.uint8]:
        across, down = self._gradients(grey)
        # All values are integers below 2 ** 24, which single precision represents exactly.
        parts = np.empty((8, *across.shape), np.float32)
        width, right, height, below = parts[:4]
        np.abs(across, out=width)
        np.maximum(across, 0.0, out=right)
        np.abs(down, out=height)
        np.maximum(down, 0.0, out=below)
        for half, one, other in zip(
            parts[4:], (width, right, width, right), (height, height, below, below), strict=True
        ):
            np.minimum(one, other, out=half)
        parts[0:2] -= parts[4:6]
        parts[2:4] -= parts[4::2]
        # A diagonal step is longer by the factor sqrt(2), which is about 181 / 128.
        parts[4:] *= np.float32(181 / 128)
        np.floor(parts[4:], out=parts[4:])
        rows, columns = _cell_sums(self.n_rows, self.n_columns, self.samples)
        sums = rows @ (parts.reshape(-1, columns.shape[0]) @ columns).reshape(8, rows.shape[1], -1)
        width, right, height, below, diagonal, to_right, to_below, to_both = sums
        bins = (
            right,
            to_both,
            below,
            to_below - to_both,
            width - right,
            diagonal - to_right - to_below + to_both,
            height - below,
            to_right - to_both,
        )
        return _normalised(np.stack(bins, axis=2).astype(np.float64), self.noise).ravel()

    def _gradients(self, grey: NDArray[np.uint8]) -> tuple[Singles, Singles]:
        """Return the differences across and down at the sampled points, each of shape (60, 80)."""
        rows, before, after = _sampled(grey.shape[0], self.n_rows * self.samples)
        columns, left, right = _sampled(grey.shape[1], self.n_columns * self.samples)
        lines, stripes = grey.take(rows, 0), grey.take(columns, 1)
        across = lines.take(right, 1).astype(np.float32) - lines.take(left, 1)
        down = stripes.take(after, 0).astype(np.float32) - stripes.take(before, 0)
        return across, down


@cache
def _sampled(length: int, n_points: int) -> tuple[NDArray[np.intp], ...]:
    """Return `n_points` points along a side, and the points before and after each of them."""
    points = (np.arange(n_points) * length + length // 2) // n_points
    return points, points - 1, np.minimum(points + 1, length - 1)


@cache
def _cell_sums(n_rows: int, n_columns: int, samples: int) -> tuple[Singles, Singles]:
    """Return the matrices `left` and `right`: `left @ samples @ right` sums each cell's samples."""
    ones = np.ones(samples, np.float32)
    return np.kron(np.eye(n_rows, dtype=np.float32), ones), np.kron(
        np.eye(n_columns, dtype=np.float32), ones[:, None]
    )


def _normalised(cells: NDArray[np.float64], noise: float) -> NDArray[np.uint8]:
    """Divide each cell by the energy of its 3x3 neighbourhood, then take the square root."""
    rows, columns = cells.shape[:2]
    energy = np.zeros((rows + 2, columns + 2))  # np.pad takes ten times as long
    energy[1:-1, 1:-1] = np.einsum("ijk,ijk->ij", cells, cells)
    around = energy[:-2] + energy[1:-1] + energy[2:]
    around = around[:, :-2] + around[:, 1:-1] + around[:, 2:]
    shares = cells / np.sqrt(around + noise**2)[:, :, None]
    scaled: NDArray[np.uint8] = (255.0 * np.sqrt(shares) + 0.5).astype(np.uint8)
    return scaled


def sum_over_cells(
    pixels: NDArray[np.float64], parts: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Return each cell's sum of squared pixels plus its share of `parts`, shape (6, 8).

    A cell has 5x5 of the 40x30 pixels. `parts` are sums over areas of the picture, arranged in rows
    and columns. The function spreads each sum evenly over its area.
    """
    squares = (pixels * pixels).reshape(THUMBNAIL_HEIGHT, THUMBNAIL_WIDTH)
    if parts is not None:
        high, wide = THUMBNAIL_HEIGHT // parts.shape[0], THUMBNAIL_WIDTH // parts.shape[1]
        squares = squares + np.kron(parts, np.full((high, wide), 1 / (high * wide)))
    high, wide = THUMBNAIL_HEIGHT // CELL_ROWS, THUMBNAIL_WIDTH // CELL_COLUMNS
    sums: NDArray[np.float64] = squares.reshape(CELL_ROWS, high, CELL_COLUMNS, wide).sum(
        axis=(1, 3)
    )
    return sums
