"""Features from a vision net's output in each part of a frame, and the default learner with these
features."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot.lab.eyes.network import CHANNELS, COLUMNS, HEIGHT, ROWS, WIDTH, Network
from robot.learner.base import Vector
from robot.learner.classifier import BSOCClassifier
from robot.learner.ridge import ContextRidge
from robot.policy import image
from robot.policy.features import (
    COMMON_SIDES,
    THUMBNAIL_HEIGHT,
    THUMBNAIL_WIDTH,
    PictureFeatures,
    sum_over_cells,
)
from robot.policy.policy import Policy
from robot.types import Action, Frame


class EyesFeatures(PictureFeatures):
    """The features are the outputs of a pretrained vision network, whose weights never change, for
    2x5 parts of the picture. A grey picture follows; its contrast is reduced to a quarter.

    A vector has 2000 bytes. The grey part is for the gallery and for comparing frames. At this
    contrast the grey part contributes little to distances.
    """

    name = "eyes"
    n_rows, n_columns = 2, 5
    n_outputs = n_others = n_rows * n_columns * CHANNELS
    contrast = 4
    step = 24.0
    """Change of an element of the vector if an output of the network changes by one standard
    deviation. The mean output has the value 128."""
    penalty = 0.2
    """Penalty of the linear part.

    Robots that have learned few examples drive better with a smaller penalty. Robots that have
    learned many examples drive better with a larger one.
    """
    balance = 0.25
    """Extra weight of rare labels. A low weight is enough: with the features of a vision net, a
    robot learns a turn from few examples."""
    novelty_margin = 0.3
    """Margin of the novelty. By the network's outputs, an unknown corner seems more novel than by
    gradients. With the default margin, a robot would ask for help three times as often after a
    short lesson, and drive no better."""

    def __init__(self) -> None:
        self._network = Network()

    def extract(self, frame: Frame) -> Vector:
        """Return shape (2000,), uint8: 80 channels of 2x5 parts, then 30x40 grey values."""
        import cv2

        rgb = image.at_common_scale(image.to_rgb(frame), *COMMON_SIDES)
        small = image.rgb_to_grey(image.shrink(rgb, THUMBNAIL_WIDTH, THUMBNAIL_HEIGHT))
        outputs = self._network.run(np.asarray(cv2.resize(rgb, (WIDTH, HEIGHT)), np.uint8))
        high, wide = ROWS // self.n_rows, COLUMNS // self.n_columns
        means = outputs.reshape(CHANNELS, self.n_rows, high, self.n_columns, wide).mean((2, 4))
        values = np.clip(128.5 + self.step * means, 0, 255).astype(np.uint8)
        return np.concatenate([values.ravel(), small.ravel() >> 2])

    def cells(self, difference: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return one number for each part of the picture: the sum of the squared differences of its
        outputs and pixels."""
        by_output = (difference[: self.n_outputs] ** 2).reshape(CHANNELS, self.n_rows, -1)
        parts = by_output.sum(axis=0)
        return sum_over_cells(difference[self.n_outputs :], parts)


def make_eyes(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return the default learner on a frozen vision net's outputs; needs the extra `eyes`."""
    features = EyesFeatures()
    linear = ContextRidge(features.n_outputs, penalty=EyesFeatures.penalty)
    learner = BSOCClassifier(
        number,
        linear=linear,
        balance=EyesFeatures.balance,
        novelty_margin=EyesFeatures.novelty_margin,
    )
    return Policy(name, number, learner, features, moves=moves, brighten=features.brightened)
