"""The policy learns proportional steering beside moves, and proposes it in the pilot's style."""

from __future__ import annotations

import math
import random
from functools import cache

import numpy as np
import pytest

from robot.learner.base import State
from robot.learner.classifier import BSOCClassifier
from robot.learner.ridge import ContextRidge
from robot.moves import CLASSIC, move_at, point_of
from robot.policy.events import Taught
from robot.policy.history import TrainingHistory
from robot.policy.recognition import BAND
from robot.policy.registry import make_policy
from robot.policy.undo import undo_examples
from robot.store.models.model import same_nodes
from robot.types import Action, Example, Frame, Mode, Point
from tests.kit.frames import frame_of
from tests.kit.sizes import crossed
from tests.kit.states import same_state
from tests.learners import installed
from tests.robot.bench_robot import BenchRobot

LEARNERS = installed("default-8", "published-8", "integer-8")
OF_POINTS = {"degrees_sums", "node_angles", "angles"}
"""Arrays that a model contains only if something was taught with proportional steering."""


@cache
def view(bend: float, noise: int) -> Frame:
    """A picture of a bright stripe that lies further right in sharper bends."""
    columns = np.abs(np.arange(160) - 80 - 60 * bend) < 12
    dice = np.random.default_rng((noise, 1 + round(bend * 1e6) % 2**31))
    pixels = 40 + 150 * columns[None, :, None] + dice.integers(0, 12, (120, 160, 3))
    return frame_of(pixels)


def way(seed: int, frames: int) -> list[float]:
    """Return the bend of the path at each frame."""
    dice = random.Random(seed)
    waves = [(dice.uniform(0.02, 0.2), dice.uniform(0.0, math.tau)) for _ in range(3)]
    return [sum(math.sin(f * i + phase) for f, phase in waves) / 3 for i in range(frames)]


def proportional(bend):
    return Point(bend, 0.6 - 0.2 * abs(bend))


def all_or_nothing(bend):
    return Point((bend > 0.2) - (bend < -0.2), 0.5)


def move_of(point):
    return move_at(point, CLASSIC.values()) or Action.FORWARD


def teach(history, seed, frames, *, pilot=proportional, has_point=lambda i: True, first=0):
    """Teach this number of frames; those without a point are taught by their moves."""
    for i, bend in enumerate(way(seed, frames), start=first):
        label, point = move_of(pilot(bend)), pilot(bend) if has_point(i) else None
        example = Example(frame_id=i, label=label, is_intervention=False, point=point)
        history.teach(example, history.policy.extract(view(bend, i)), 0.1 * i)


def taught(learner, seed, frames, **how):
    history = TrainingHistory(make_policy(learner))
    teach(history, seed, frames, **how)
    return history


def answers(policy, seed, frames=60):
    """Return the bends of another path, each with the proposed move and point."""
    policy.reset()
    found = []
    for i, bend in enumerate(way(seed, frames)):
        said = policy.propose(i + 1, policy.extract(view(bend, 1000 + i)))
        assert all(-1.0 <= number <= 1.0 for number in said.point)
        found.append((bend, said.action, said.point))
    return found


@crossed(learner=LEARNERS, seed=range(3))
def test_the_moves_are_learned_bit_for_bit_as_without_proportional_steering(learner, seed):
    alone = taught(learner, seed, 90, has_point=lambda i: False).policy
    beside = taught(learner, seed, 90, has_point=lambda i: i % 7 > 1).policy
    moves, points = alone.get_state(), beside.get_state()
    assert not OF_POINTS & moves.arrays.keys() and OF_POINTS & points.arrays.keys()
    arrays = {name: array for name, array in points.arrays.items() if name not in OF_POINTS}
    assert same_nodes(moves, State(points.kind, points.params, arrays, points.labels))
    for i, bend in enumerate(way(seed + 10, 40)):
        one, two = (policy.propose(i, policy.extract(view(bend, i))) for policy in (alone, beside))
        assert one.point is None and one.spread is None and two.point is not None
        assert (one.action, one.probabilities) == (two.action, two.probabilities)
        assert (one.confidence, one.novelty) == (two.confidence, two.novelty)


def test_on_a_body_without_proportional_steering_a_curve_counts_as_a_turn():
    policy, helpless = taught("default-8", 0, 90).policy, {}
    for takes_points in (True, False):
        policy.reset()
        known = {"under_way": None, "takes_points": takes_points}
        for i in range(600):
            x = policy.extract(view(-0.4, i % 8))
            said = policy.propose(i, x, at_s=20.0 + 0.1 * i, **known)
            assert (said.point is not None) is takes_points
            known["under_way"] = Action.LEFT
            helpless[takes_points] = helpless.get(takes_points) or said.needs_help
    assert helpless == {True: False, False: True}, "half of full lock gets on, a full turn does not"


@crossed(learner=LEARNERS, seed=range(3))
def test_points_are_undone_as_if_they_had_never_been(learner, seed):
    n_alone = random.Random(seed).randrange(20, 120)
    history = taught(learner, seed, n_alone, has_point=lambda i: False)
    alone = history.policy.get_state()
    teach(history, seed + 1, 60, first=n_alone)
    assert history.policy.usual_point(Action.LEFT) is not None
    assert len(undo_examples(history, 5.95)) == 60
    assert same_state(history.policy.get_state(), alone)
    assert history.policy.propose(1, history.policy.extract(view(0.0, 0))).point is None


def test_a_model_with_a_move_steered_beyond_full_lock_is_refused():
    state = taught("default-8", 0, 30).policy.get_state()
    state.arrays["degrees_sums"][:, 1] *= -10.0
    crafted = make_policy("default-8")
    crafted.restore(state)
    with pytest.raises(ValueError, match="the steering of its moves is outside"):
        crafted.check()


def test_the_linear_angle_is_that_of_all_examples_whenever_proportional_steering_began():
    """An example that was taught as a move counts with the move's declared steering."""
    dice = np.random.default_rng(4)
    xs = dice.integers(0, 256, (70, 12)).astype(np.uint8)
    labels = dice.integers(0, 3, 70)
    angles = np.where(np.arange(70) < 30, labels - 1.0, dice.uniform(-1.0, 1.0, 70))
    both = np.stack([angles, abs(angles)], axis=1)
    ridge = ContextRidge(12)
    for _ in range(3):
        ridge.add_label()
    for i, x in enumerate(xs):
        if i == 30:
            ridge.begin_angles(np.array([-1.0, 0.0, 1.0]))
        ridge.learn(x, np.eye(3)[labels[i]], angle=both[i], contexts=(i % 2,))
    z = np.hstack([xs / 255.0, np.ones((70, 1))])
    batch = np.linalg.solve(z.T @ z + 3.0 * np.eye(13), z.T @ both)
    for x, row in zip(xs, z, strict=True):
        assert ridge.angle(x) == pytest.approx(row @ batch, abs=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_images_keep_the_angles_of_their_frames_through_merges_and_edits(seed):
    dice, learner, total = random.Random(seed), BSOCClassifier(5), 0.0
    learner.begin_angles({})
    for _ in range(60):
        angle = dice.uniform(-1.0, 1.0)
        x = np.array([angle, dice.random()], np.float32)
        learner.learn_in(x, str(move_of(Point(angle, 0.5))), (0, 1), angle)
        total += angle
    nodes = learner.nodes()
    assert sum(sum(n.votes.values()) * (n.angle or 0.0) for n in nodes) == pytest.approx(total)
    chosen = dice.choice(nodes)
    learner.relabel_node(chosen.id, "left", -0.6)
    assert next(n for n in learner.nodes() if n.id == chosen.id).angle == pytest.approx(-0.6)
    learner.delete_node(chosen.id)
    rest = {n.id: n.angle for n in nodes if n.id != chosen.id}
    assert {n.id: n.angle for n in learner.nodes()} == pytest.approx(rest)
    learner.check()


@crossed(learner=LEARNERS, seed=range(2))
def test_a_robot_of_a_pilot_who_steers_all_or_nothing_steers_likewise(learner, seed):
    policy = taught(learner, seed, 200, pilot=all_or_nothing).policy
    for _, action, point in answers(policy, seed + 30):
        assert point == point_of(action)


@crossed(learner=["default-32", "published-32"], seed=range(2))
def test_proportional_steering_is_imitated_more_closely_than_moves_allow(learner, seed):
    policy = taught(learner, seed, 250).policy
    said = answers(policy, seed + 30, 150)
    means = {move: policy.usual_point(move) or Point(0.0, 0.0) for _, move, _ in said}
    off = np.mean([abs(point.steering - bend) for bend, _, point in said])
    by_moves = np.mean([abs(means[move].steering - bend) for bend, move, _ in said])
    assert off < 0.8 * by_moves
    for _, move, point in said:  # the point is never far from this pilot's usual point
        assert abs(point.steering - means[move].steering) < BAND


@crossed(learner=LEARNERS, seed=range(2))
def test_an_obstacle_that_is_passed_on_either_side_is_not_driven_into(learner, seed):
    """The mean of hard left and hard right would be straight on."""
    dice, policy = random.Random(seed), make_policy(learner)
    for i in range(160):
        near = dice.uniform(0.4, 1.0)
        point = Point(dice.choice((-1, 1)) * near, 0.5)
        policy.learn(policy.extract(view(near, i)), move_of(point), None, point)
    off = []
    for i in range(60):
        near = 0.5 if i % 30 < 15 else 0.9
        said = policy.propose(i, policy.extract(view(near, 1000 + i)))
        assert said.action is move_of(said.point)
        off.append(abs(abs(said.point.steering) - near))
    assert np.mean(off) < 0.15


def test_the_steering_changes_sides_smoothly():
    policy = taught("default-32", 0, 250).policy
    policy.reset()
    bends = [-0.5] * 3 + [0.5] * 3
    said = [policy.propose(i, policy.extract(view(b, i))).point for i, b in enumerate(bends)]
    steering = [point.steering for point in said]
    assert steering[2] < 0.0 < steering[4] <= steering[5]
    assert steering[2] < steering[3] < steering[5] - 0.1


def test_a_stick_that_agrees_with_the_robot_corrects_nothing():
    robot = BenchRobot("default-8")
    robot.driver.takes_points = True
    robot.start(Mode.TRAIN)
    for scene in range(1, 12):
        robot.step(scene % 3, Action.LEFT, seconds=0.1, point=Point(-0.5, 0.4))
    robot.start(Mode.AUTONOMOUS, scene=1)
    assert robot.loop.state.prediction.point.steering == pytest.approx(-0.5)
    for off, is_correction in ((0.5, False), (1.5, True), (-1.5, True)):
        point = Point(-0.5 + off * 0.1, 0.4)
        events = robot.step(1, Action.LEFT, seconds=0.1, point=point).history_events
        [example] = [event.example for event in events if isinstance(event, Taught)]
        assert example.is_intervention is is_correction
    robot.hold(None)
    tick = robot.tick()
    assert tick.decision.point == tick.prediction.point == robot.driver.point is not None
    robot.driver.takes_points = False
    robot.camera.show(1)
    said = robot.tick().prediction
    assert said.action is Action.LEFT and said.point is None
