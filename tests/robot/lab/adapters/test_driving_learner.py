"""In another program's loop, the driving learner does the same as in ours, including undo."""

import math

import numpy as np
import pytest

from robot.control.online_learning import OnlineLearning
from robot.lab.adapters.driving_learner import DrivingLearner
from robot.moves import CLASSIC, Move
from robot.policy.registry import make_policy
from robot.testing import VirtualClock
from robot.types import Action, PilotCommand, Point
from tests.kit.frames import frame_of, noisy_blocks

MOVES = ("left", "right", "gas")


def test_a_move_is_known_by_its_effect_and_not_by_its_name():
    classic = ("left", "right", "forward", "brake")
    own = dict(zip(classic, ("wander", "bend", "hurry", "ease"), strict=True))
    declared = [
        Move(Action(own[move.name]), steering=move.steering, throttle=move.throttle)
        for move in map(CLASSIC.__getitem__, map(Action, classic[:3]))
    ]
    learners = DrivingLearner(classic), DrivingLearner([*declared, own["brake"]])
    rng = np.random.default_rng(3)
    for i in range(120):
        move = classic[i // 6 % 4] if i < 40 or rng.random() < 0.3 else None
        first, second = (learner.see(noisy_blocks(i // 6 % 5, i), 0.1 * i) for learner in learners)
        assert [own[name] for name in first.probabilities] == list(second.probabilities)
        assert list(first.probabilities.values()) == list(second.probabilities.values())
        assert first.action is None or own[first.action] == second.action
        if move is not None:
            learners[0].teach(move)
            learners[1].teach(own[move])


def test_the_driving_learner_equals_the_learner_of_the_control_loop():
    rng = np.random.default_rng(5)
    own = DrivingLearner(MOVES)
    policy = make_policy("default-32", tuple(Action(move) for move in MOVES))
    loop, under_way = OnlineLearning(policy, VirtualClock()), None
    for i in range(80):
        pixels, at_s = noisy_blocks(i // 7 % 4, i), 0.1 * i
        loop.look(frame_of(pixels, i + 1, at_s), under_way)
        assert own.see(pixels, at_s) == loop.prediction
        under_way, held = loop.prediction.action, None
        if i < 30 or rng.random() < 0.3:
            under_way, held = None, MOVES[i // 7 % 3]
            own.teach(held, is_correction=i >= 30)
        action = Action(held) if held else None
        command = PilotCommand(held=action, frame_id=i + 1, seq=i, received_s=at_s)
        loop.learn([command], is_intervention=i >= 30, may_learn=True)
    assert own.n_examples == loop.history.taught.total()


def test_bad_input_is_named_and_teaches_nothing():
    with pytest.raises(ValueError, match="two moves"):
        DrivingLearner(["gas"])
    learner = DrivingLearner(MOVES)
    with pytest.raises(ValueError, match="see"):
        learner.teach("gas")
    with pytest.raises(ValueError, match="shape"):
        learner.see(np.zeros((120, 160), np.uint8), 0.0)
    learner.see(noisy_blocks(1), 0.0)
    with pytest.raises(ValueError, match="fly"):
        learner.teach("fly")
    for steering in (math.nan, 1.5, -1e30):
        with pytest.raises(ValueError, match="must lie in"):
            learner.teach("left", point=Point(steering, 0.5))
    learner.teach("left", point=Point(-0.5, 0.5))
    assert learner.see(noisy_blocks(1), 0.1).point == Point(-0.5, 0.5)


def test_teaching_can_be_undone_and_an_invalid_time_is_refused():
    learner = DrivingLearner(MOVES)
    for i in range(30):
        learner.see(noisy_blocks(1, i), 0.1 * i)
        learner.teach("gas" if i < 20 else "left")
    for at_s in (math.nan, math.inf):
        with pytest.raises(ValueError, match="seconds"):
            learner.see(noisy_blocks(1), at_s)
        with pytest.raises(ValueError, match="see"):  # an earlier picture is not taught twice
            learner.teach("gas")
    assert learner.undo(0.95) == 10
    assert learner.n_examples == 20
    assert learner.see(noisy_blocks(1, 99), 3.1).action == "gas"
