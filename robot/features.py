"""A frame as the vector that a learner compares: small grey pictures and gradient orientations."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from robot import image
from robot.learner.base import Vector
from robot.types import Frame

THUMBNAIL_WIDTH, THUMBNAIL_HEIGHT = 40, 30
"""The paper's picture: 160x120 shrunk by four."""


class Features(Protocol):
    """A pure function from frame to vector, and the way back to something a person can see."""

    name: str

    def extract(self, frame: Frame) -> Vector:
        """Return the frame's vector. Raises CameraError for bytes that are no image."""
        ...

    def thumbnail(self, x: Vector) -> NDArray[np.uint8]:
        """Return the picture of a vector (of a node's, say), shape (30, 40) or (30, 40, 3)."""
        ...


class GreyFeatures:
    """Grey, 40x30, area average: 1200 bytes."""

    name = "grey"

    def extract(self, frame: Frame) -> Vector:
        """Return shape (1200,), uint8."""
        return image.to_small_grey(frame, THUMBNAIL_WIDTH, THUMBNAIL_HEIGHT).ravel()

    def thumbnail(self, x: Vector) -> NDArray[np.uint8]:
        """Return shape (30, 40)."""
        return np.asarray(x).reshape(THUMBNAIL_HEIGHT, THUMBNAIL_WIDTH).clip(0, 255).astype("u1")


class GradientFeatures:
    """Histograms of gradient orientations beside a faint grey picture.

    Dalal and Triggs (2005), simplified: cells of 5x5 pixels of the 40x30 picture, signed
    directions in 8 bins, each cell divided by the energy of its 3x3 neighbourhood, then the
    square root. The grey part, scaled by `grey_weight`, tells apart plain surfaces that have no
    gradients, and is the node's thumbnail.
    """

    name = "gradient"
    cell = 5
    n_bins = 8

    def __init__(self, grey_weight: float = 0.1) -> None:
        self.grey_weight = grey_weight

    def extract(self, frame: Frame) -> Vector:
        """Return shape (1584,), float32: 8x6 cells of 8 bins, then 40x30 pixels."""
        small = image.shrink(image.to_grey(frame), THUMBNAIL_WIDTH, THUMBNAIL_HEIGHT)
        grey = small.astype(np.float32) * np.float32(self.grey_weight / 255.0)
        return np.concatenate([self._histograms(small), grey.ravel()])

    def thumbnail(self, x: Vector) -> NDArray[np.uint8]:
        """Return shape (30, 40)."""
        grey = np.asarray(x)[-THUMBNAIL_WIDTH * THUMBNAIL_HEIGHT :] * (255.0 / self.grey_weight)
        pixels = grey.round().clip(0, 255).astype(np.uint8)
        return pixels.reshape(THUMBNAIL_HEIGHT, THUMBNAIL_WIDTH)

    def _histograms(self, small: NDArray[np.uint8]) -> NDArray[np.float32]:
        padded = np.pad(small.astype(np.float32), 1, mode="edge")
        across = padded[1:-1, 2:] - padded[1:-1, :-2]
        down = padded[2:, 1:-1] - padded[:-2, 1:-1]
        strength = np.hypot(across, down)
        turn = np.arctan2(down, across) * (self.n_bins / (2 * np.pi))
        bins = np.floor(turn).astype(np.intp) % self.n_bins  # what bincount takes on 32 bits too
        rows, columns = small.shape[0] // self.cell, small.shape[1] // self.cell
        cell_row = np.arange(small.shape[0]) // self.cell
        cell_column = np.arange(small.shape[1]) // self.cell
        cells = cell_row[:, None] * columns + cell_column[None, :]
        votes = np.bincount(
            (cells * self.n_bins + bins).ravel(), strength.ravel(), rows * columns * self.n_bins
        ).reshape(rows, columns, self.n_bins)
        return _normalised(votes.astype(np.float64)).astype(np.float32).ravel()


def _normalised(votes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Divide each cell by the energy of its 3x3 neighbourhood, then take the square root."""
    energy = np.pad((votes**2).sum(axis=2), 1)
    rows, columns = votes.shape[:2]
    around = sum(energy[r : r + rows, c : c + columns] for r in range(3) for c in range(3))
    # The floor is a gradient of about one grey level a pixel: below it is the camera's noise.
    return np.sqrt(votes / np.sqrt(around + 50.0**2)[:, :, None])
