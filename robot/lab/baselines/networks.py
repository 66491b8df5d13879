"""Small neural networks on colour pixels, fitted anew in batch as examples come."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from robot.learner.base import Label, Vector
from robot.policy import image
from robot.policy.features import THUMBNAIL_HEIGHT, THUMBNAIL_WIDTH, GreyFeatures
from robot.types import Frame

Floats = NDArray[np.float32]
_EPOCHS, _BATCH = 30, 16
_RATE, _DECAYS, _TINY = 0.001, (0.9, 0.999), 1e-8
"""Of Adam (Kingma and Ba 2015)."""


class ColourFeatures(GreyFeatures):
    """RGB, 40x30, area average: 3600 bytes."""

    name = "colour"

    def extract(self, frame: Frame) -> Vector:
        return image.shrink(image.to_rgb(frame), THUMBNAIL_WIDTH, THUMBNAIL_HEIGHT).ravel()

    def thumbnail(self, x: Vector) -> NDArray[np.uint8]:
        pixels = np.asarray(x).reshape(THUMBNAIL_HEIGHT, THUMBNAIL_WIDTH, 3)
        return pixels.round().clip(0, 255).astype(np.uint8)

    def grey(self, x: Vector) -> NDArray[np.uint8]:
        return image.rgb_to_grey(self.thumbnail(x)).ravel()

    def cells(self, difference: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the sums of squares over parts of 5x5 pixels and all colours."""
        return super().cells(np.sqrt((difference.reshape(-1, 3) ** 2).sum(axis=1)))


class BatchClassifier:
    """Fits a network by going over all examples some times; for a `Baseline`."""

    def __init__(self, network: Any) -> None:
        self._network = network
        self.classes_: list[Label] = []

    def fit(self, xs: Floats, ys: list[Label]) -> None:
        """Go over the examples, in another order each time; the same for the same examples."""
        self.classes_ = sorted(set(ys))
        scaled, labels = xs / 127.5 - 1.0, np.array([self.classes_.index(y) for y in ys])
        numbers = list(range(max(2, len(self.classes_))))  # scikit-learn wants two
        for part in _parts(len(ys)):
            self._network.partial_fit(scaled[part], labels[part], classes=numbers)

    def predict_proba(self, xs: Floats) -> Floats:
        """Return the chance of each class, shape (n, classes)."""
        chances: Floats = self._network.predict_proba(xs / 127.5 - 1.0)
        if chances.shape[1] == 1:  # of two classes scikit-learn gives the second alone
            chances = np.hstack([1.0 - chances, chances])
        chances = chances[:, : len(self.classes_)]
        shares: Floats = chances / chances.sum(axis=1, keepdims=True)
        return shares


class BatchRegressor:
    """The same of one number: the network with a linear output instead of the softmax."""

    def __init__(self, n_hidden: int) -> None:
        self._network = ConvolutionalNetwork(n_hidden, has_softmax=False)

    def fit(self, xs: Floats, ys: list[float]) -> None:
        """Go over the examples as `BatchClassifier` does; the loss is half the squared error."""
        scaled, targets = xs / 127.5 - 1.0, np.array(ys, np.float32)[:, None]
        for part in _parts(len(ys)):
            self._network.step(scaled[part], targets[part])

    def predict(self, xs: Floats) -> Floats:
        """Return the number for each picture, shape (n,)."""
        numbers: Floats = self._network.predict_proba(xs / 127.5 - 1.0)[:, 0]
        return numbers


def _parts(n_examples: int) -> Iterator[NDArray[np.intp]]:
    """Yield all examples some times, each time in another order, in small batches."""
    rng = np.random.default_rng(0)
    for _ in range(_EPOCHS):
        yield from np.array_split(rng.permutation(n_examples), max(1, n_examples // _BATCH))


class ConvolutionalNetwork:
    """Two layers of 5x5 and 3x3 convolutions with stride 2, a hidden layer, and a softmax.

    Args:
        n_hidden: Units of the hidden layer.
        shape: Of a picture: height, width, channels.
        has_softmax: False: its outputs are numbers, not chances.
    """

    def __init__(
        self,
        n_hidden: int,
        shape: tuple[int, int, int] = (THUMBNAIL_HEIGHT, THUMBNAIL_WIDTH, 3),
        kernels: tuple[tuple[int, int], ...] = ((5, 12), (3, 24)),
        has_softmax: bool = True,
    ) -> None:
        self._has_softmax = has_softmax
        self._shape, self._kernels, self._n_hidden = shape, kernels, n_hidden
        self.weights: list[Floats] = []
        self._moments: list[tuple[Floats, Floats]] = []
        self._n_steps = 0

    def partial_fit(self, xs: Floats, columns: NDArray[np.intp], classes: list[int]) -> None:
        """Make one step of Adam on some examples."""
        self.step(xs, np.eye(len(classes), dtype=np.float32)[columns])

    def step(self, xs: Floats, targets: Floats) -> None:
        """The same with what each output should be, shape (n, outputs)."""
        if not self.weights:
            self._begin(targets.shape[1])
        self._n_steps += 1
        for i, slope in enumerate(self.slopes(xs, targets)):
            mean, square = self._moments[i]
            mean += (1 - _DECAYS[0]) * (slope - mean)
            square += (1 - _DECAYS[1]) * (slope * slope - square)
            unbiased = [
                moment / (1 - decay**self._n_steps)
                for moment, decay in zip((mean, square), _DECAYS, strict=True)
            ]
            self.weights[i] -= _RATE * unbiased[0] / (np.sqrt(unbiased[1]) + _TINY)

    def predict_proba(self, xs: Floats) -> Floats:
        return self._forward(xs)[1]

    def slopes(self, xs: Floats, targets: Floats) -> list[Floats]:
        """Return the slope by each weight of the mean loss, which is cross entropy after a softmax
        and half the squared error without: by the outputs, both have the same slope."""
        inputs, outputs = self._forward(xs)
        error: Floats = outputs - targets
        error /= len(xs)
        slopes: list[Floats] = []
        for i in reversed(range(len(self.weights))):
            seen = inputs[i]
            error = error.reshape(*seen.shape[:-1], -1)
            flat = seen.reshape(-1, seen.shape[-1])
            slopes.append(flat.T @ error.reshape(len(flat), -1))
            if i == 0:
                break
            back = (error @ self.weights[i].T)[..., :-1]
            if i < len(self._kernels):
                back = self._fold(back, i)
            before = inputs[i - 1] @ self.weights[i - 1] > 0.0
            error = back.reshape(before.shape) * before
        return slopes[::-1]

    def _begin(self, n_classes: int) -> None:
        rng = np.random.default_rng(0)
        height, width, depth = self._shape
        sizes, self._shapes = [], [self._shape]
        for side, n_filters in self._kernels:
            sizes.append((side * side * depth, n_filters))
            height, width, depth = (height - side) // 2 + 1, (width - side) // 2 + 1, n_filters
            self._shapes.append((height, width, depth))
        sizes += [(height * width * depth, self._n_hidden), (self._n_hidden, n_classes)]
        for n_in, n_out in sizes:
            spread = rng.normal(0.0, np.sqrt(2.0 / n_in), (n_in, n_out))
            self.weights.append(np.vstack([spread, np.zeros((1, n_out))]).astype(np.float32))
        self._moments = [(np.zeros_like(w), np.zeros_like(w)) for w in self.weights]

    def _forward(self, xs: Floats) -> tuple[list[Floats], Floats]:
        """Return what each layer sees, with a one for its bias, and the outputs."""
        inputs: list[Floats] = []
        values: Floats = xs.reshape(-1, *self._shape)
        for i, weights in enumerate(self.weights):
            if i < len(self._kernels):
                side = self._kernels[i][0]
                windows = sliding_window_view(values, (side, side), axis=(1, 2))
                parts = windows[:, ::2, ::2]
                values = parts.reshape(*parts.shape[:3], -1)
            else:
                values = values.reshape(len(xs), -1)
            ones = np.ones((*values.shape[:-1], 1), values.dtype)
            inputs.append(np.concatenate([values, ones], axis=-1))
            values = inputs[-1] @ weights
            if i < len(self.weights) - 1:
                values = np.maximum(values, 0.0)
        if not self._has_softmax:
            return inputs, values
        powers = np.exp(values - values.max(axis=1, keepdims=True))
        return inputs, powers / powers.sum(axis=1, keepdims=True)

    def _fold(self, slopes: Floats, layer: int) -> Floats:
        """Add up the slopes of a layer's windows over the picture that they were cut from."""
        side = self._kernels[layer][0]
        n, rows, columns, _ = slopes.shape
        whole = np.zeros((n, *self._shapes[layer]), slopes.dtype)
        windows = slopes.reshape(n, rows, columns, -1, side, side)
        for y in range(side):
            for x in range(side):
                whole[:, y : y + 2 * rows : 2, x : x + 2 * columns : 2][:, :rows, :columns] += (
                    windows[..., y, x]
                )
        return whole
