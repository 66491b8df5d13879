"""The net that is shipped has the outputs that it had when it was made of the published weights."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from robot.errors import ConfigurationError
from robot.lab.eyes import network
from robot.lab.eyes.network import CHANNELS, COLUMNS, HEIGHT, ROWS, WIDTH, Network

SEEN = [-0.321, 1.045, 1.027, 0.832]
"""Outputs of four channels at the picture's corner."""


def photograph(seed: int) -> NDArray[np.uint8]:
    """Return a picture with edges of all sizes."""
    rng = np.random.default_rng(seed)
    sizes = (4, 8, 16, 32)
    layers = [
        np.kron(rng.normal(size=(HEIGHT // n, WIDTH // n, 3)), np.ones((n, n, 1))) for n in sizes
    ]
    return (120 + 30 * sum(layers)).clip(0, 255).astype(np.uint8)


def test_it_sees_what_it_saw_when_it_was_made() -> None:
    """At that time plain numpy, layer by layer, had the same outputs to 0.002."""
    outputs = Network().run(photograph(1))
    assert outputs.shape == (CHANNELS, ROWS, COLUMNS)
    np.testing.assert_allclose(outputs[::20, 0, 0], SEEN, atol=5e-3)


def test_its_outputs_are_about_standardised() -> None:
    outputs = np.array([Network().run(photograph(seed)) for seed in range(5)])
    assert abs(outputs.mean()) < 0.3
    assert 0.5 < outputs.std() < 1.5


def test_a_damaged_net_says_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(network, "_HERE", tmp_path)
    for name in ("usual.npy", "net.onnx"):
        with pytest.raises(ConfigurationError, match="install drivelesson again"):
            Network()
        (tmp_path / name).write_bytes(b"not one")
