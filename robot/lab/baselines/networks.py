"""Small neural networks on colour pixels, fitted again to all examples as examples are added."""

from __future__ import annotations

from collections.abc import Sequence
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
"""Parameters of Adam (Kingma and Ba 2015)."""


class ColourFeatures(GreyFeatures):
    """Colour features: 40x30 RGB pixels, averaged over areas; 3600 bytes. Learners with these
    features have no images to show."""

    name = "colour"

    def extract(self, frame: Frame) -> Vector:
        return image.shrink(image.to_rgb(frame), THUMBNAIL_WIDTH, THUMBNAIL_HEIGHT).ravel()

    def grey(self, x: Vector) -> NDArray[np.uint8]:
        return image.rgb_to_grey(x.reshape(THUMBNAIL_HEIGHT, THUMBNAIL_WIDTH, 3)).ravel()


class BatchNetwork:
    """A classifier for a `Baseline`: a network, which is fitted in several passes over all
    examples.

    The network learns classes, or numbers if it has no softmax.
    """

    def __init__(self, network: Any) -> None:
        self._network = network
        self.classes_: Sequence[Label] = ()

    def fit(self, xs: Floats, ys: list[Any]) -> None:
        """Fit the network in several passes over the examples, each in a different order. Equal
        examples yield equal networks."""
        scaled, targets, classes = xs / 127.5 - 1.0, np.array(ys), {}
        if isinstance(ys[0], str):
            found, targets = np.unique(targets, return_inverse=True)
            self.classes_ = found.tolist()
            # scikit-learn needs at least two classes
            classes = {"classes": list(range(max(2, len(self.classes_))))}
        rng = np.random.default_rng(0)
        for _ in range(_EPOCHS):
            order = rng.permutation(len(ys))
            for part in np.array_split(order, max(1, len(ys) // _BATCH)):
                self._network.partial_fit(scaled[part], targets[part], **classes)

    def predict(self, xs: Floats) -> Floats:
        """Return the number that the network without a softmax computes for each picture, shape
        (n,)."""
        numbers: Floats = self._network.predict_proba(xs / 127.5 - 1.0)[:, 0]
        return numbers

    def predict_proba(self, xs: Floats) -> Floats:
        """Return the probability of each class, shape (n, classes)."""
        chances: Floats = self._network.predict_proba(xs / 127.5 - 1.0)
        # scikit-learn returns one column if there are two classes: that of the second class
        if chances.shape[1] == 1:
            chances = np.hstack([1.0 - chances, chances])
        chances = chances[:, : len(self.classes_)]
        shares: Floats = chances / chances.sum(axis=1, keepdims=True)
        return shares


class ConvolutionalNetwork:
    """Two layers of 5x5 and 3x3 convolutions with stride 2, a hidden layer, and a softmax.

    All layers compute sums over values of the layer before: a convolution over each window, a full
    layer over all values.

    Args:
        n_hidden: Number of units in the hidden layer.
        shape: Shape of a picture: height, width, channels.
        kernels: Kernel side and number of kernels of each convolution layer.
        has_softmax: False if the output is a number, not probabilities.
    """

    def __init__(
        self,
        n_hidden: int,
        shape: tuple[int, int, int] = (THUMBNAIL_HEIGHT, THUMBNAIL_WIDTH, 3),
        kernels: tuple[tuple[int, int], ...] = ((5, 12), (3, 24)),
        has_softmax: bool = True,
    ) -> None:
        self._has_softmax = has_softmax
        self._widths = [*(n_filters for _, n_filters in kernels), n_hidden]
        self._places: list[NDArray[np.intp]] = []
        for side, n_filters in kernels:
            values = np.arange(np.prod(shape)).reshape(shape)
            windows = sliding_window_view(values, (side, side), axis=(0, 1))[::2, ::2]
            shape = (*windows.shape[:2], n_filters)
            self._places.append(windows.reshape(shape[0] * shape[1], -1))
        self._places += [np.arange(n_values)[None] for n_values in (np.prod(shape), n_hidden)]
        self.weights: list[Floats] = []
        self._moments: list[tuple[Floats, Floats]] = []
        self._n_steps = 0

    def partial_fit(
        self, xs: Floats, ys: NDArray[Any], classes: Sequence[int] | None = None
    ) -> None:
        """Make one step of Adam on some examples. `ys` are the numbers of classes, or the target
        values if there is no softmax."""
        self.step(xs, ys[:, None] if classes is None else np.eye(len(classes))[ys])

    def step(self, xs: Floats, targets: NDArray[Any]) -> None:
        """Make one step, given the target of each output, shape (n, outputs)."""
        targets = targets.astype(np.float32)
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
        """Return the gradient of the mean loss with respect to each weight. The loss is the cross
        entropy if there is a softmax, otherwise half the squared error. Both losses have the same
        gradient with respect to the outputs."""
        layers, outputs = self._forward(xs)
        error: Floats = outputs - targets
        error /= len(xs)
        slopes: list[Floats] = []
        for i, (values, seen) in reversed(list(enumerate(layers))):
            error = error.reshape(*seen.shape[:2], -1)
            slopes.append(np.tensordot(seen, error, ((0, 1), (0, 1))))
            if i > 0:  # the first layer's input, the picture, needs no gradient
                back = (error @ self.weights[i].T)[..., :-1]
                error = np.zeros_like(values)
                for place, parts in enumerate(self._places[i]):
                    error[:, parts] += back[:, place]
                error *= values > 0.0
        return slopes[::-1]

    def _begin(self, n_outputs: int) -> None:
        rng = np.random.default_rng(0)
        for places, n_out in zip(self._places, (*self._widths, n_outputs), strict=True):
            n_in = places.shape[1]
            spread = rng.normal(0.0, np.sqrt(2.0 / n_in), (n_in, n_out))
            self.weights.append(np.vstack([spread, np.zeros((1, n_out))]).astype(np.float32))
        self._moments = [(np.zeros_like(w), np.zeros_like(w)) for w in self.weights]

    def _forward(self, xs: Floats) -> tuple[list[tuple[Floats, Floats]], Floats]:
        """Return the inputs of the layers, and the outputs. Each layer's inputs are returned as a
        pair. The first array has the plain values, shape (n, values). The second has the values in
        the windows of a convolution, shape (n, windows, values per window + 1). The last value of
        each window is 1, for the bias."""
        layers: list[tuple[Floats, Floats]] = []
        values: Floats = xs
        for places, weights in zip(self._places, self.weights, strict=True):
            ones = np.ones((len(xs), len(places), 1), values.dtype)
            layers.append((values, np.concatenate([values[:, places], ones], axis=-1)))
            outputs = (layers[-1][1] @ weights).reshape(len(xs), -1)
            values = np.maximum(outputs, 0.0)
        if not self._has_softmax:
            return layers, outputs
        powers: Floats = np.exp(outputs - outputs.max(axis=1, keepdims=True))
        powers /= powers.sum(axis=1, keepdims=True)
        return layers, powers
