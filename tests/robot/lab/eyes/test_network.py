"""The net that OpenCV runs is the one whose weights were read: by plain numpy, layer by layer."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from robot.errors import MissingExtraError
from robot.lab.eyes.network import CHANNELS, COLUMNS, HEIGHT, ROWS, WIDTH, Network
from robot.lab.eyes.weights import Weights, load_weights

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def trained() -> Weights:
    try:
        return load_weights()
    except MissingExtraError as error:
        pytest.skip(f"NOT TESTED: {error}")


def photograph(seed: int) -> NDArray[np.uint8]:
    """Return a picture with edges of all sizes."""
    rng = np.random.default_rng(seed)
    sizes = (4, 8, 16, 32)
    layers = [
        np.kron(rng.normal(size=(HEIGHT // n, WIDTH // n, 3)), np.ones((n, n, 1))) for n in sizes
    ]
    return (120 + 30 * sum(layers)).clip(0, 255).astype(np.uint8)


def convolved(x: Array, kernels: Array, step: int) -> Array:
    """Convolve (channels, rows, columns) as TensorFlow does with the padding "same"."""
    size = kernels.shape[-1]
    needed = [max(((side - 1) // step) * step + size - side, 0) for side in x.shape[1:]]
    x = np.pad(x, [(0, 0), *((n // 2, n - n // 2) for n in needed)])
    windows = np.lib.stride_tricks.sliding_window_view(x, (size, size), axis=(1, 2))
    windows = windows[:, ::step, ::step]
    if kernels.shape[1] == 1 and x.shape[0] > 1:
        return np.einsum("crwij,cij->crw", windows, kernels[:, 0])
    return np.einsum("crwij,kcij->krw", windows, kernels, optimize=True)


def normalised(x: Array, trained: Weights, name: str) -> Array:
    mean, variance, scale, offset = (
        trained[f"{name}.{part}"][:, None, None]
        for part in ("running_mean", "running_var", "weight", "bias")
    )
    return scale * (x - mean) / np.sqrt(variance + 1e-3) + offset


def seen(rgb: NDArray[np.uint8], trained: Weights) -> Array:
    """Return the eighth block's outputs: the architecture as published, written out."""

    def layer(x: Array, conv: str, norm: str, step: int = 1) -> Array:
        kernels = trained[f"{conv}.weight"].astype(float)
        return normalised(convolved(x, kernels, step), trained, norm)

    x = (rgb.transpose(2, 0, 1).astype(float) - 127.0) / 128.0
    x = layer(x, "_conv_stem", "_bn0", 2).clip(0, 6)
    steps = [1, 2, 1, 2, 1, 2, 1, 1]
    for i, step in enumerate(steps):
        entry, block = x, f"_blocks.{i}."
        if i > 0:
            x = layer(x, f"{block}_expand_conv", f"{block}_bn0").clip(0, 6)
        x = layer(x, f"{block}_depthwise_conv", f"{block}_bn1", step).clip(0, 6)
        x = layer(x, f"{block}_project_conv", f"{block}_bn2")
        if x.shape == entry.shape:
            x = x + entry
    return x


def test_it_computes_what_the_published_net_does(trained: Weights) -> None:
    net, rgb = Network(), photograph(1)
    outputs = net.run(rgb)
    assert outputs.shape == (CHANNELS, ROWS, COLUMNS)
    np.testing.assert_allclose(outputs * net.spread + net.usual, seen(rgb, trained), atol=2e-3)


def test_its_outputs_are_about_standardised(trained: Weights) -> None:
    outputs = np.array([Network().run(photograph(seed)) for seed in range(5)])
    assert abs(outputs.mean()) < 0.3
    assert 0.5 < outputs.std() < 1.5
