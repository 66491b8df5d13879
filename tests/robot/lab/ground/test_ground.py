"""In third-party worlds, teacher and robot drive in turn, and the teachers score well."""

import contextlib
import importlib.util

import numpy as np
import pytest

from robot.errors import ConfigurationError
from robot.lab.adapters.driving_learner import DrivingLearner
from robot.lab.ground.run import FIRST_EXAMPLES, Course, drive_alone, run_ground
from robot.lab.ground.worlds import WORLDS, Picture, make_world
from robot.types import Point
from tests.kit.sizes import IS_FULL


class Lamp:
    """A world with one lamp, left or right; a turn to the lamp scores a point."""

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


class Turncoat(Lamp):
    """A teacher that wants the other side from the third drive on."""

    n_drives = 0

    def reset(self, seed: int) -> Picture:
        self.n_drives += 1
        return super().reset(seed)

    def wanted(self) -> str:
        return self.moves[self._side if self.n_drives < 3 else 1 - self._side]


def taught(world: Lamp, way: str, examples: int) -> tuple[DrivingLearner, Course]:
    learner = DrivingLearner(Lamp.moves, "published-8")
    course = Course(world, learner, way, seed=1)
    course.teach(examples)
    return learner, course


def test_in_a_demonstration_only_the_teacher_drives():
    learner, course = taught(Lamp(), "demonstration", 90)
    assert (learner.n_examples, course.decisions, course.takeovers) == (90, 90, 0)
    assert drive_alone(Lamp(), learner, 5) == Lamp.longest


def test_only_mistakes_are_corrected_up_to_the_number_of_examples():
    learner, course = taught(Lamp(), "corrections", 60)
    assert (learner.n_examples, course.takeovers) == (FIRST_EXAMPLES, 0)
    assert course.decisions > 10 * FIRST_EXAMPLES, "the robot had enough decisions to learn"
    learner, course = taught(Turncoat(), "corrections", 60)
    assert learner.n_examples == 60 and course.takeovers >= 1


CARS = [name for name in WORLDS if name.startswith("CarRacing")]
LIBRARY = {"ViZDoom": "vizdoom", **dict.fromkeys(CARS, "Box2D")}
GOOD = {"YMaze": 0.0, "ViZDoom": 1900.0, **dict.fromkeys(CARS, 25.0)}
"""Minimum score of a teacher's drives in each world; in a maze a teacher may get lost."""
TRIED = sorted(WORLDS) if IS_FULL else ["CarRacing", "Hallway", "ViZDoom", "YMaze"]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.slow
@pytest.mark.parametrize("name", TRIED)
def test_the_teacher_reaches_the_goal_and_a_run_reports_it(name):
    for library in ("gymnasium", LIBRARY.get(name, "miniworld")):
        if importlib.util.find_spec(library) is None:
            pytest.skip(f"NOT TESTED: {library} is not installed (the extra ground)")
    with contextlib.closing(make_world(name)) as world:
        first = world.reset(11)
        assert first.dtype == np.uint8 and first.ndim == 3 and first.shape[2] == 3
        assert (world.reset(11) == first).all(), "the same seed gives the same episode"
        assert (world.reset(12) != first).any()
        is_over, n = False, 0
        while not is_over:
            _, is_over = world.step(world.wanted(), world.point)
            n += 1
        assert n <= world.longest
        assert world.score >= GOOD.get(name, 1.0)
    if name not in (*CARS, "YMaze"):  # these worlds take long, and would show nothing new
        params = {"world": name, "way": "corrections", "seed": 3, "counts": [60], "drives": 1}
        (stage,) = run_ground({**params, "learner": "knn-1"})["stages"]
        assert 50 <= stage["examples"] <= 60 and len(stage["scores"]) == 1
        (stage,) = run_ground({**params, "learner": "teacher"})["stages"]
        assert stage["scores"][0] >= GOOD.get(name, 1.0)


def test_an_unknown_world_is_named():
    with pytest.raises(ConfigurationError, match="Sidewalk"):
        make_world("Sidewalc")
