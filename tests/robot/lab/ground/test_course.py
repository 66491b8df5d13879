"""Who drives at which time in a third-party world, and what counts as an example."""

from __future__ import annotations

import numpy as np
import pytest

from robot.lab.adapters.driving_learner import DrivingLearner
from robot.lab.chance import interval
from robot.lab.ground.run import FIRST_EXAMPLES, Course, drive_alone
from robot.lab.ground.worlds import Picture
from robot.types import Point


class Lamp:
    """A world with one lamp, left or right: a turn to the lamp scores a point."""

    moves = ("port", "starboard")
    longest = 40
    point: Point | None = None

    def reset(self, seed: int) -> Picture:
        self._rng = np.random.default_rng(seed)
        self.score, self._n = 0.0, 0
        self.points: list[Point | None] = []
        return self._show()

    def step(self, move: str, point: Point | None = None) -> tuple[Picture, bool]:
        self.points.append(point)
        self.score += move == self.wanted()
        self._n += 1
        return self._show(), self._n >= self.longest

    def wanted(self) -> str:
        return self.moves[self._side]

    def close(self) -> None:
        pass

    def _show(self) -> Picture:
        self._side = int(self._rng.integers(2))
        picture = self._rng.integers(0, 40, (120, 160, 3)).astype(np.uint8)
        picture[30:90, 100 * self._side + 10 : 100 * self._side + 50] = 250
        return picture


@pytest.fixture
def learner() -> DrivingLearner:
    return DrivingLearner(Lamp.moves, "knn-1")


def test_in_a_demonstration_only_the_teacher_drives(learner: DrivingLearner) -> None:
    course = Course(Lamp(), learner, "demonstration", seed=1)
    course.teach(90)
    assert (learner.n_examples, course.decisions, course.takeovers) == (90, 90, 0)
    assert drive_alone(Lamp(), learner, 5) == Lamp.longest


def test_a_world_that_is_driven_proportionally_is_driven_as_the_teacher_meant() -> None:
    class Dimmer(Lamp):
        def wanted(self) -> str:
            self.point = Point(0.7 if self._side else -0.4, 0.5)
            return super().wanted()

    world, learner = Dimmer(), DrivingLearner(Lamp.moves, "knn-1")
    Course(world, learner, "demonstration", seed=1).teach(60)
    assert set(world.points) == {Point(0.7, 0.5), Point(-0.4, 0.5)}
    drive_alone(world, learner, 5)
    driven = [point for point in world.points if point is not None]
    assert {round(point.steering, 2) for point in driven} == {0.7, -0.4}


def test_a_learner_without_mistakes_is_not_corrected(learner: DrivingLearner) -> None:
    course = Course(Lamp(), learner, "corrections", seed=1)
    course.teach(100)
    assert learner.n_examples == FIRST_EXAMPLES
    assert course.takeovers == 0
    assert course.decisions > 10 * FIRST_EXAMPLES, "it had its chances"


def test_a_learner_that_is_always_wrong_is_corrected_up_to_its_number_of_examples() -> None:
    class Turncoat(Lamp):
        """Wants the other side in every drive except the first ones."""

        n_drives = 0

        def reset(self, seed: int) -> Picture:
            self.n_drives += 1
            return super().reset(seed)

        def wanted(self) -> str:
            return self.moves[self._side if self.n_drives < 3 else 1 - self._side]

    learner = DrivingLearner(Turncoat.moves, "knn-1")
    course = Course(Turncoat(), learner, "corrections", seed=1)
    course.teach(100)
    assert learner.n_examples == 100
    assert course.takeovers >= 1


def test_the_confidence_interval_of_a_mean_is_right() -> None:
    low, high = interval([0.0, 1.0] * 50)
    assert 0.35 < low < 0.45 < 0.55 < high < 0.65
    assert interval([2.0, 2.0]) == (2.0, 2.0)
