"""The lab's convolutional network: its gradients are those of its loss, and it learns."""

from __future__ import annotations

import numpy as np
import pytest

from robot.lab.baselines.networks import BatchNetwork, ConvolutionalNetwork


def small(n_hidden: int = 5, has_softmax: bool = True) -> ConvolutionalNetwork:
    kernels = ((3, 4), (3, 6))
    return ConvolutionalNetwork(n_hidden, (11, 13, 2), kernels, has_softmax=has_softmax)


@pytest.mark.parametrize("has_softmax", [True, False])
def test_each_gradient_equals_that_of_the_loss(has_softmax: bool) -> None:
    rng = np.random.default_rng(3)
    network = small(has_softmax=has_softmax)
    xs, columns = rng.normal(size=(4, 11 * 13 * 2)), np.array([0, 2, 1, 2])
    targets = np.eye(3)[columns] if has_softmax else rng.normal(size=(4, 1))
    network.step(xs, targets)
    network.weights = [weights.astype(np.float64) for weights in network.weights]

    def loss() -> float:
        outputs = network.predict_proba(xs)
        if has_softmax:
            return float(-np.log(outputs[np.arange(len(xs)), columns]).mean())
        return float(((outputs - targets) ** 2).mean() / 2)

    for weights, slopes in zip(network.weights, network.slopes(xs, targets), strict=True):
        for _ in range(20):
            place = tuple(int(rng.integers(side)) for side in weights.shape)
            middle, step = weights[place], 1e-5
            sides = []
            for weights[place] in (middle - step, middle + step):
                sides.append(loss())
            weights[place] = middle
            measured = (sides[1] - sides[0]) / (2 * step)
            assert abs(measured - slopes[place]) < 1e-4 + 0.02 * abs(measured)


def test_it_tells_where_the_bright_spot_is() -> None:
    def pictures(seed: int, n: int) -> tuple[np.ndarray, list[str]]:
        rng = np.random.default_rng(seed)
        xs = rng.integers(0, 120, (n, 11, 13, 2)).astype(np.float32)
        sides = rng.integers(0, 2, n)
        for picture, side in zip(xs, sides, strict=True):
            x, y = 8 * side + rng.integers(0, 3), rng.integers(0, 9)
            picture[y : y + 2, x : x + 2] += 120
        return xs.reshape(n, -1), ["right" if side else "left" for side in sides]

    classifier = BatchNetwork(small(24))
    classifier.fit(*pictures(1, 300))
    xs, ys = pictures(2, 100)
    best = classifier.predict_proba(xs).argmax(axis=1)
    right = sum(classifier.classes_[i] == y for i, y in zip(best, ys, strict=True))
    assert right >= 85
