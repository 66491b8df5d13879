"""The learners that the paper compares with BSOC."""

from __future__ import annotations

import numpy as np
import pytest

from robot.policy.registry import make_policy
from robot.types import Action


@pytest.fixture(scope="module", autouse=True)
def _rivals() -> None:
    """Import the libraries only in the worker that runs these tests; it takes two seconds."""
    for library in ("minisom", "minigng", "sklearn"):
        pytest.importorskip(library, reason="NOT TESTED: the extra rivals is not installed")


def pictures(n: int) -> list[tuple[np.ndarray, Action]]:
    """A bright bar on one side, which moves a little."""
    rng, made = np.random.default_rng(1), []
    for i in range(n):
        picture = rng.integers(30, 60, (30, 40)).astype(np.uint8)
        at = int(rng.integers(0, 6)) + (28 if i % 2 else 2)
        picture[:, at : at + 6] = 200
        made.append((picture.ravel(), Action.RIGHT if i % 2 else Action.LEFT))
    return made


@pytest.mark.parametrize("name", ["som-9", "gng-9", "alvinn-4"])
def test_it_tells_two_kinds_of_pictures_apart(name: str) -> None:
    policy, other = make_policy(name), make_policy(name)
    for x, label in pictures(60):
        policy.learn(x, label)
    asked = pictures(90)[60:]
    assert [policy.propose(i, x).action for i, (x, _) in enumerate(asked)] == [y for _, y in asked]
    other.set_state(policy.get_state())
    x = asked[0][0]
    assert other.propose(1, x).probabilities == policy.propose(99, x).probabilities


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["som-1", "som-4", "gng-2", "alvinn-4"])
def test_one_example_is_enough(name: str) -> None:
    policy = make_policy(name)
    x, label = pictures(1)[0]
    policy.learn(x, label)
    assert policy.propose(1, x).action is label
