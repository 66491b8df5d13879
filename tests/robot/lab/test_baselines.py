"""The learners that BSOC is compared with: those of the paper, and the lab's own networks."""

import numpy as np
import pytest

from robot.lab.baselines.networks import ConvolutionalNetwork
from robot.policy.registry import make_policy
from robot.types import Action


def pictures(n: int) -> list[tuple[np.ndarray, Action]]:
    """A bright bar on one side, which moves a little."""
    rng, made = np.random.default_rng(1), []
    for i in range(n):
        picture = rng.integers(30, 60, (30, 40)).astype(np.uint8)
        at = int(rng.integers(0, 6)) + (28 if i % 2 else 2)
        picture[:, at : at + 6] = 200
        made.append((picture.ravel(), Action.RIGHT if i % 2 else Action.LEFT))
    return made


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["som-9", "som-1", "gng-9", "gng-2", "alvinn-4"])
def test_it_learns_from_the_first_example_on_and_its_state_can_be_moved(name):
    for library in ("minisom", "minigng", "sklearn"):
        pytest.importorskip(library, reason="NOT TESTED: the extra rivals is not installed")
    policy, other = make_policy(name), make_policy(name)
    (first, label), *more = pictures(60)
    policy.learn(first, label)
    assert policy.propose(1, first).action is label
    for x, label in more:
        policy.learn(x, label)
    asked = pictures(90)[60:]
    if name.partition("-")[2] not in "12":  # one or two nodes cannot tell two kinds apart
        proposed = [policy.propose(i, x).action for i, (x, _) in enumerate(asked)]
        assert proposed == [y for _, y in asked]
    other.set_state(policy.get_state())
    x = asked[0][0]
    assert other.propose(1, x).probabilities == policy.propose(99, x).probabilities


@pytest.mark.parametrize("has_softmax", [True, False])
def test_each_gradient_of_a_network_equals_that_of_its_loss(has_softmax):
    rng = np.random.default_rng(3)
    kernels = ((3, 4), (3, 6))
    network = ConvolutionalNetwork(5, (11, 13, 2), kernels, has_softmax=has_softmax)
    xs, columns = rng.normal(size=(4, 11 * 13 * 2)), np.array([0, 2, 1, 2])
    targets = np.eye(3)[columns] if has_softmax else rng.normal(size=(4, 1))
    network.step(xs, targets)
    network.weights = [weights.astype(np.float64) for weights in network.weights]

    def loss():
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
