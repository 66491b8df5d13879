from __future__ import annotations

import numpy as np
import pytest

from robot.lab.place_index import BinaryFeatures
from robot.lab.places import MultiPlace
from robot.learner.base import NotFittedError
from robot.learner.classifier import BSOCClassifier


def view(place, scene, noise):
    """A grey picture of 30x40 that shares its layout with others of its place."""
    layout = np.kron(np.random.default_rng(place).integers(0, 200, (6, 8)), np.ones((5, 5)))
    detail = np.kron(np.random.default_rng(90 + scene).integers(0, 40, (15, 20)), np.ones((2, 2)))
    grain = np.random.default_rng(noise).integers(0, 6, (30, 40))
    return (layout + detail + grain).astype(np.uint8).ravel()


def teach(learner, place, labels, n=40):
    learner.reset()
    for i in range(n):
        learner.learn_one(view(place, i % 2, i), labels[i % 2])


@pytest.fixture
def learner():
    return MultiPlace(lambda: BSOCClassifier(4), BinaryFeatures(30, 40))


def test_each_place_keeps_its_own_network(learner):
    teach(learner, 1, ("left", "right"))
    teach(learner, 2, ("right", "left"))
    teach(learner, 1, ("left", "right"))
    assert [network.n_seen_ for network in learner.networks_] == [80, 40]
    learner.reset()
    assert learner.predict_one(view(1, 0, 99)) == "left"
    learner.reset()
    assert learner.predict_one(view(2, 0, 99)) == "right"


def test_new_views_within_a_drive_stay_in_its_place(learner):
    teach(learner, 1, ("left", "right"))
    for i in range(30):
        learner.learn_one(view(50 + i, 0, i), "left")
    assert len(learner.networks_) == 1


def test_state_gives_the_same_future(learner):
    teach(learner, 1, ("left", "right"))
    teach(learner, 2, ("right", "left"), n=5)  # these wait for their place
    other = MultiPlace(lambda: BSOCClassifier(4), BinaryFeatures(30, 40))
    other.set_state(learner.get_state())
    for both in (learner, other):
        for i in range(20):
            both.learn_one(view(2, i % 2, 7 + i), "forward")
    assert (
        [n.n_seen_ for n in learner.networks_] == [n.n_seen_ for n in other.networks_] == [40, 25]
    )
    x = view(2, 1, 3)
    assert learner.predict_proba_one(x) == other.predict_proba_one(x)


def test_refuses_bad_lessons_and_stays_as_it_was(learner):
    with pytest.raises(NotFittedError):
        learner.predict_one(view(1, 0, 0))
    teach(learner, 1, ("left", "right"))
    for x, y in [(np.zeros(3), "left"), (np.full(1200, np.nan), "left"), (view(1, 0, 0), "")]:
        with pytest.raises(ValueError, match=r"vector|label"):
            learner.learn_one(x, y)
    assert learner.n_seen_ == 40
