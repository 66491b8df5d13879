"""Lets a policy that LeRobot trained drive a Drivelesson robot. The policy does not learn further.

Set the environment variable DRIVELESSON_LEROBOT_POLICY to the policy's folder, such as
outputs/train/.../checkpoints/last/pretrained_model, and start with `--learner lerobot`.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from lerobot.common.control_utils import predict_action
from lerobot.configs import PreTrainedConfig
from lerobot.policies.factory import get_policy_class, make_pre_post_processors
from lerobot.utils.constants import OBS_STATE

from robot.errors import ConfigurationError
from robot.learner.base import BaseLearner, Evidence, State
from robot.moves import point_of
from robot.policy.features import THUMBNAIL_HEIGHT, THUMBNAIL_WIDTH, GreyFeatures
from robot.policy.image import to_rgb, to_small_grey
from robot.policy.policy import Policy
from robot.types import Action, Encoding, Frame

FOLDER = "DRIVELESSON_LEROBOT_POLICY"
_SHARPNESS = 4.0
"""A move's probability is proportional to exp(-_SHARPNESS * its distance from the output)."""


class WholePicture(GreyFeatures):
    """Features: the picture in colour, in the size with which the policy was trained."""

    name = "picture"

    def __init__(self, height: int, width: int) -> None:
        self.shape = height, width, 3

    def extract(self, frame: Frame) -> Any:
        """Return shape (height * width * 3,), uint8."""
        height, width, _ = self.shape
        return cv2.resize(to_rgb(frame), (width, height), interpolation=cv2.INTER_AREA).ravel()

    def thumbnail(self, x: Any) -> Any:
        """Return shape (30, 40)."""
        return self.grey(x).reshape(THUMBNAIL_HEIGHT, THUMBNAIL_WIDTH)

    def grey(self, x: Any) -> Any:
        """Return shape (1200,)."""
        height, width, _ = self.shape
        frame = Frame(
            frame_id=1,
            captured_s=0.0,
            width=width,
            height=height,
            encoding=Encoding.RGB,
            data=np.asarray(x, np.uint8).tobytes(),
        )
        return to_small_grey(frame, THUMBNAIL_WIDTH, THUMBNAIL_HEIGHT).ravel()


class TrainedPolicy(BaseLearner):
    """Turns a policy's steering and throttle into the nearest move."""

    kind = "lerobot"

    def __init__(self, folder: Path, moves: tuple[Action, ...]) -> None:
        config = PreTrainedConfig.from_pretrained(folder)
        config.device = "cpu"
        images = config.image_features
        [action] = config.action_feature.shape
        state = config.robot_state_feature
        if len(images) != 1 or action != 2 or (state is not None and state.shape != (2,)):
            raise ConfigurationError(
                f"the policy {folder} has the inputs {', '.join(config.input_features)} and "
                f"{action} outputs; its inputs must be one picture and, optionally, the robot's "
                f"steering and throttle, and its outputs steering and throttle"
            )
        self._has_state = state is not None
        self._doing = np.zeros(2, np.float32)
        [(self.camera, feature)] = images.items()
        self.height, self.width = feature.shape[1:]
        self.points = {str(move): point for move in moves if (point := point_of(move))}
        self._folder = folder
        self._policy = get_policy_class(config.type).from_pretrained(folder, config=config)
        self._before, self._behind = make_pre_post_processors(config, str(folder))

    def learn_one(self, x: Any, y: str) -> None:
        """Do nothing: the policy is already trained."""

    def explain_one(self, x: Any) -> Evidence:
        """Return a probability for each move: the nearer to the policy's output, the higher."""
        picture = np.asarray(x, np.uint8).reshape(self.height, self.width, 3)
        seen = {self.camera: picture}
        if self._has_state:
            seen[OBS_STATE] = self._doing
        said = predict_action(
            seen,
            self._policy,
            torch.device("cpu"),
            self._before,
            self._behind,
            use_amp=False,
        )
        away = np.linalg.norm(np.array([*self.points.values()]) - said.numpy().ravel(), axis=1)
        shares = np.exp(-_SHARPNESS * (away - away.min()))
        shares /= shares.sum()
        probabilities = dict(zip(self.points, shares.tolist(), strict=True))
        label = max(probabilities, key=probabilities.__getitem__)
        self._doing = np.array(self.points[label], np.float32)
        return Evidence(label=label, probabilities=probabilities, confidence=probabilities[label])

    def reset(self) -> None:
        """Clear the policy's planned actions, and assume that the robot stands still."""
        self._policy.reset()
        self._doing = np.zeros(2, np.float32)

    def get_state(self) -> State:
        """Return the path of the policy's folder."""
        return State(kind=self.kind, params={"folder": str(self._folder)})

    def set_state(self, state: State) -> None:
        """Accept only the state of a learner of this kind."""
        if state.kind != self.kind:
            raise ValueError(f"this is the state of a {state.kind!r} learner, not {self.kind!r}")


def make_lerobot(number: int, name: str, moves: tuple[Action, ...], integer: bool) -> Policy:
    """Return the policy from the folder that DRIVELESSON_LEROBOT_POLICY names; a `Maker`."""
    if not os.environ.get(FOLDER):
        raise ConfigurationError(
            f"the environment variable {FOLDER} is not set; set it to the folder of the policy"
        )
    learner = TrainedPolicy(Path(os.environ[FOLDER]).expanduser(), moves)
    return Policy(name, number, learner, WholePicture(learner.height, learner.width), moves=moves)
