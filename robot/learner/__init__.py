"""Learners that learn online from labelled examples. This package needs only numpy.

Example:
    >>> import numpy as np
    >>> learner = BSOCClassifier(max_nodes=32)
    >>> learner.learn_one(np.array([0.0, 1.0]), "left")
    >>> learner.predict_one(np.array([0.1, 0.9]))
    'left'
"""

from robot.learner.base import (
    Abilities,
    BaseLearner,
    Evidence,
    Label,
    Learner,
    Mirror,
    Node,
    NotFittedError,
    State,
    Vector,
)
from robot.learner.bsoc import BSOC
from robot.learner.classifier import BSOCClassifier
from robot.learner.published import PublishedBSOC

__all__ = [
    "BSOC",
    "Abilities",
    "BSOCClassifier",
    "BaseLearner",
    "Evidence",
    "Label",
    "Learner",
    "Mirror",
    "Node",
    "NotFittedError",
    "PublishedBSOC",
    "State",
    "Vector",
]
