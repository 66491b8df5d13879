"""The features of a pretrained vision network, and a learner that uses them."""

import numpy as np
import pytest
from numpy.typing import NDArray

from robot.errors import CameraError, ConfigurationError
from robot.lab.eyes import network
from robot.lab.eyes.features import EyesFeatures
from robot.lab.eyes.network import CHANNELS, COLUMNS, HEIGHT, ROWS, WIDTH, Network
from robot.policy.features import GreyFeatures
from robot.policy.registry import make_policy
from robot.types import Action, Encoding
from tests.kit.frames import frame_of, make_frame

Pixels = NDArray[np.uint8]


@pytest.fixture(scope="module")
def features():
    return EyesFeatures()


def room(seed: int) -> Pixels:
    blocks = np.random.default_rng(seed).integers(0, 255, (12, 16, 3))
    return np.kron(blocks, np.ones((10, 10, 1), int)).astype(np.uint8)


def test_the_vector_is_pure_for_any_size_of_camera_and_contains_its_thumbnail(features):
    x = features.extract(frame_of(room(1)))
    assert (x.shape, x.dtype) == ((2000,), np.uint8)
    for times in (1, 2, 4):
        large = room(1).repeat(times, axis=0).repeat(times, axis=1)
        assert np.array_equal(x, features.extract(frame_of(large)))
    grey = GreyFeatures().extract(frame_of(room(1))).reshape(30, 40)
    assert np.abs(features.thumbnail(x).astype(int) - grey).max() <= 2
    with pytest.raises(CameraError):
        features.extract(make_frame(b"no", Encoding.RGB))


def test_the_features_of_a_part_belong_to_its_place_in_the_picture(features):
    plain = np.full((120, 160, 3), 120, np.uint8)
    for row, column in np.ndindex(2, 5):
        thing = plain.copy()
        thing[60 * row + 10 :, 32 * column + 4 :][:40, :24] = room(2)[:40, :24]
        x, y = (features.extract(frame_of(rgb)).astype(float) for rgb in (plain, thing))
        changed = np.abs(x - y)[: features.n_outputs].reshape(80, 2, 5).sum(axis=0)
        assert changed.argmax() == 5 * row + column


def test_a_difference_lies_in_its_part_and_the_parts_add_up_to_it(features):
    difference = np.zeros(2000)
    difference[: features.n_outputs].reshape(80, 2, 5)[7, 1, 4] = 3.0
    cells = features.cells(difference)
    assert np.argwhere(cells > 0).tolist() == [[r, c] for r in (3, 4, 5) for c in (6, 7)]
    difference = np.random.default_rng(0).normal(size=2000)
    assert features.cells(difference).sum() == pytest.approx((difference**2).sum())


def test_the_policy_drives_by_few_examples_in_another_light():
    """Views of three objects, from a few places; later from other places, and darker."""
    moves = (Action.FORWARD, Action.LEFT, Action.RIGHT)
    things = {move: room(seed)[:60, :60] for seed, move in enumerate(moves, 10)}

    def view(move, x, light):
        rgb = np.full((120, 160, 3), 140, np.uint8)
        rgb[60 - x // 4 : 120 - x // 4, 40 + x : 100 + x] = things[move]
        return frame_of((rgb * light).astype(np.uint8))

    policy = make_policy("eyes-32", moves=moves)
    for x in (0, 8, 16):
        for move in moves:
            policy.learn(policy.extract(view(move, x, 1.0)), move)
    for move in moves:
        policy.reset()
        for i, x in enumerate((4, 12)):
            assert policy.propose(i, policy.extract(view(move, x, 0.5))).action is move


SEEN = [-0.321, 1.045, 1.027, 0.832]
"""Recorded outputs of four channels at a corner of the picture."""


def photograph(seed: int) -> Pixels:
    """Return a picture with edges of all sizes."""
    rng = np.random.default_rng(seed)
    layers = [
        np.kron(rng.normal(size=(HEIGHT // n, WIDTH // n, 3)), np.ones((n, n, 1)))
        for n in (4, 8, 16, 32)
    ]
    return (120 + 30 * sum(layers)).clip(0, 255).astype(np.uint8)


def test_the_outputs_are_standardised_and_equal_those_of_the_original_network():
    """When `SEEN` was recorded, a plain numpy version of each layer had these outputs to 0.002."""
    outputs = np.array([Network().run(photograph(seed)) for seed in range(5)])
    assert outputs.shape == (5, CHANNELS, ROWS, COLUMNS)
    np.testing.assert_allclose(outputs[1, ::20, 0, 0], SEEN, atol=5e-3)
    assert abs(outputs.mean()) < 0.3
    assert 0.5 < outputs.std() < 1.5


def test_the_error_for_a_damaged_network_says_what_to_do(tmp_path, monkeypatch):
    monkeypatch.setattr(network, "_HERE", tmp_path)
    for name in ("usual.npy", "net.onnx"):
        with pytest.raises(ConfigurationError, match="install drivelesson again"):
            Network()
        (tmp_path / name).write_bytes(b"not one")
