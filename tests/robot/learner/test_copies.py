"""A copied or pickled learner continues to learn like the original."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable

import numpy as np

from robot.learner import BSOCClassifier
from robot.learner.bsoc import CACHED_FROM
from robot.learner.ridge import RecursiveRidge
from tests.kit.sizes import crossed

MAKERS: dict[str, Callable[[], BSOCClassifier]] = {
    "few": lambda: BSOCClassifier(6),
    "many": lambda: BSOCClassifier(CACHED_FROM),
    "ridge": lambda: BSOCClassifier(6, linear=RecursiveRidge(8)),
    "integer": lambda: BSOCClassifier(6, integer=True),
    "published": lambda: BSOCClassifier.published(6),
}
COPIES: dict[str, Callable[[BSOCClassifier], BSOCClassifier]] = {
    "deepcopy": copy.deepcopy,
    "pickle": lambda learner: pickle.loads(pickle.dumps(learner)),
}


@crossed(how=COPIES, kind=MAKERS)
def test_a_copy_learns_on_as_the_original(kind: str, how: str) -> None:
    rng = np.random.default_rng(4)
    xs = rng.integers(0, 255, (2 * CACHED_FROM + 200, 8)).astype(np.uint8)
    ys = [str(int(x[0]) // 90) for x in xs]
    one = MAKERS[kind]()
    begun = len(xs) // 2
    for x, y in zip(xs[:begun], ys, strict=False):
        one.learn_one(x, y)
    two = COPIES[how](one)
    for x, y in zip(xs[begun:], ys[begun:], strict=True):
        one.learn_one(x, y)
        two.learn_one(x, y)
        assert one.predict_proba_one(x) == two.predict_proba_one(x)
    for node, other in zip(one.nodes(), two.nodes(), strict=True):
        np.testing.assert_array_equal(node.image, other.image)
