"""The driving learner for use in another program's loop. It converts pictures and their times to
moves."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Vector
from robot.moves import Move
from robot.policy.history import TrainingHistory
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.policy.undo import undo_examples
from robot.types import DEFAULT_MOVES, Action, Encoding, Example, Frame, Point, Prediction


class DrivingLearner:
    """Features, learner, action filter and undo in one object, combined as in the control loop.

    Pass each picture to `see`. If a person made a move on a picture, pass the move to `teach`
    before the next picture. If `teach` is not called for a picture, the learner assumes that the
    robot made the move that `see` returned. Use the object on one thread only.

    Args:
        moves: The moves to choose from, at least two: names, or a `Move` if steering and throttle
            are known. Classic names such as `left` imply steering and throttle. A turn with another
            name should be a `Move`, because the learner does not recognise its name as a turn.
        learner: Name of a learner, for example `default-32`, or a policy that only this object
            uses.

    Raises:
        ConfigurationError: If there is no learner of this name.
        ValueError: If a move has no valid name, or there are fewer than two moves.
    """

    def __init__(
        self, moves: Sequence[str | Move] = DEFAULT_MOVES, learner: str | Policy = "default-32"
    ) -> None:
        declared = [move for move in moves if isinstance(move, Move)]
        names = tuple(Action(move.name if isinstance(move, Move) else move) for move in moves)
        if len(set(names)) < 2:
            raise ValueError(f"a learner needs at least two moves, not {list(moves)}")
        policy = learner if isinstance(learner, Policy) else make_policy(learner, names)
        self.history = TrainingHistory(policy, declared=declared)
        self._frame_id = 0
        self._seen: tuple[Vector, float] | None = None
        self._under_way: Action | None = None

    @property
    def policy(self) -> Policy:
        """The policy that learns. Change the policy only through `history`."""
        return self.history.policy

    @property
    def n_examples(self) -> int:
        """Number of taught examples, without the examples that were undone."""
        return self.history.taught.total()

    def see(self, picture: NDArray[np.uint8], at_s: float, *, bumped: bool = False) -> Prediction:
        """Return the decision on a picture; the decision's action is None before the first example.

        Args:
            picture: Pixels in RGB, shape (height, width, 3), uint8.
            at_s: The time of exposure in seconds. The time must be later than the previous
                picture's.
            bumped: True if a bumper is pressed.

        Raises:
            ValueError: If the pixels have another shape or type, or the time is not a finite
                number.
            CameraError: If the picture has no pixels.
        """
        self._seen = None
        if not math.isfinite(at_s):
            raise ValueError(f"at_s must be a finite number of seconds, not {at_s}")
        pixels = np.asarray(picture)
        if pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.dtype != np.uint8:
            raise ValueError(
                "a picture must have the shape (height, width, 3) and the type uint8, not "
                f"{pixels.shape} and {pixels.dtype}"
            )
        self._frame_id += 1
        height, width = pixels.shape[:2]
        frame = Frame(
            frame_id=self._frame_id,
            captured_s=at_s,
            width=width,
            height=height,
            encoding=Encoding.RGB,
            data=pixels.tobytes(),
        )
        x = self.policy.extract(frame)
        prediction = self.policy.propose(
            self._frame_id, x, under_way=self._under_way, at_s=at_s, bumped=bumped
        )
        self._seen = x, at_s
        self._under_way = Action.STOP if prediction.needs_help else prediction.action
        return prediction

    def teach(self, move: str, *, is_correction: bool = False, point: Point | None = None) -> None:
        """Learn the move that a person made on seeing the last picture.

        Args:
            move: The person's move.
            is_correction: True if the learner was driving and the person took over.
            point: Steering and throttle, if the person steered proportionally.

        Raises:
            ValueError: If the move is not one of `moves`, if a value of the point is not from -1 to
                1, or if no picture was seen since the last call.
        """
        if self._seen is None:
            raise ValueError("there is no new picture to learn: call see() before each teach()")
        x, at_s = self._seen
        example = Example(
            frame_id=self._frame_id,
            label=Action(move),
            is_intervention=is_correction,
            point=None if point is None else Point(*map(float, point)),
        )
        self.history.teach(example, x, at_s)
        self._seen = self._under_way = None

    def undo(self, seconds: float) -> int:
        """Unlearn the last `seconds` of teaching, at most 35; return the number of examples
        unlearned."""
        return len(undo_examples(self.history, seconds))

    def reset(self) -> None:
        """Begin another drive. Keep the learned examples, and drop the state of the last drive."""
        self.history.begin_drive()
        self._seen = self._under_way = None
