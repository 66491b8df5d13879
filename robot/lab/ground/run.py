"""Runs one learner in one third-party world. Teaching and unaided driving alternate."""

from __future__ import annotations

import contextlib

from robot.lab.adapters.driving_learner import DrivingLearner
from robot.lab.ground.worlds import STEP_S, ForeignWorld, make_world
from robot.lab.ideas import make_learner
from robot.lab.task import Params, Result
from robot.types import Action, Prediction

FIRST_EXAMPLES = 50
"""Number of examples in the first demonstration. After the demonstration the robot drives, and the
teacher corrects it or answers its requests for help."""
WRONG_FOR = 2
"""Number of wrong decisions in a row after which the teacher takes the wheel."""
HOLDS_FOR = 5
"""Minimum number of decisions for which the teacher drives after a correction. Then the robot
drives again as soon as it proposes the same move as the teacher."""
UNSURE = 0.6
"""Confidence below which a robot asks for help, if it may ask. Such a robot also asks whenever
Drivelesson's own loop would ask."""
_PATIENCE = 20
"""Maximum number of decisions for each example that the learner lacked at the beginning. Then
teaching ends, because a robot that makes no mistakes gets no corrections."""
_ALONE_SEED = 1_000_000
TEACHER = "teacher"
"""Name that stands for the scripted teacher in place of a learner: the teacher drives, and its
score is measured."""


def run_ground(params: Params) -> Result:
    """Teach a robot in stages. After each stage, when it has a given number of examples, let it
    drive without the teacher.

    Parameters: `world`, `learner`, `way` (`demonstration`, `corrections` or `asked`), `seed`,
    `counts` (numbers of examples), `drives` (number of unaided drives at each count). The learner
    `teacher` is the world's scripted teacher, scored on the same drives.
    """
    with contextlib.closing(make_world(params["world"])) as world:
        first_seed = _ALONE_SEED + 100 * params["seed"]
        seeds = range(first_seed, first_seed + params["drives"])
        if params["learner"] == TEACHER:
            scores = [_score_of_teacher(world, seed) for seed in seeds]
            return {"stages": [{"scores": scores}] * len(params["counts"])}
        moves = tuple(Action(move) for move in world.moves)
        learner = DrivingLearner(moves, make_learner(params["learner"], moves))
        course = Course(world, learner, params["way"], params["seed"])
        stages = []
        for count in params["counts"]:
            course.teach(count)
            had = {"examples": learner.n_examples, "takeovers": course.takeovers}
            scores = [drive_alone(world, learner, seed) for seed in seeds]
            stages.append({**had, "scores": scores})
    return {"stages": stages}


def _score_of_teacher(world: ForeignWorld, seed: int) -> float:
    world.reset(seed)
    while not world.step(world.wanted(), world.point)[1]:
        pass
    return world.score


class Course:
    """Teaches a learner over as many episodes as needed, and decides who drives."""

    def __init__(self, world: ForeignWorld, learner: DrivingLearner, way: str, seed: int) -> None:
        self._world, self._learner, self._way = world, learner, way
        self._seed = 1000 * seed
        self._wrong = self._held = 0
        self.takeovers = self.decisions = 0

    def teach(self, count: int) -> None:
        """Continue teaching until the learner has `count` examples, or no longer makes mistakes."""
        most = self.decisions + _PATIENCE * (count - self._learner.n_examples)
        while self._learner.n_examples < count and self.decisions < most:
            self._drive(count, most)

    def _drive(self, count: int, most: int) -> None:
        self._seed += 1
        self._wrong = self._held = 0
        self._learner.reset()
        picture, is_over = self._world.reset(self._seed), False
        while not is_over and self._learner.n_examples < count and self.decisions < most:
            self.decisions += 1
            proposed = self._learner.see(picture, STEP_S * self.decisions)
            wanted = self._world.wanted()
            is_first = self._way == "demonstration" or self._learner.n_examples < FIRST_EXAMPLES
            if is_first or self._is_teacher_due(proposed, wanted):
                point = self._world.point
                self._learner.teach(wanted, is_correction=not is_first, point=point)
                move: str | None = wanted
            else:
                move, point = None if proposed.needs_help else proposed.action, proposed.point
            if move is not None:  # otherwise the robot stands still and asks for help
                picture, is_over = self._world.step(move, point)

    def _is_teacher_due(self, proposed: Prediction, wanted: str) -> bool:
        is_wrong = proposed.action != wanted
        if self._held > 0:
            self._held = self._held + 1 if is_wrong or self._held < HOLDS_FOR else 0
            return self._held > 0
        self._wrong = self._wrong + 1 if is_wrong else 0
        asks = proposed.is_novel or proposed.needs_help or proposed.confidence < UNSURE
        if asks if self._way == "asked" else self._wrong >= WRONG_FOR:
            self.takeovers += 1
            self._held, self._wrong = 1, 0
        return self._held > 0


def drive_alone(world: ForeignWorld, learner: DrivingLearner, seed: int) -> float:
    """Return the score of one episode without a teacher."""
    learner.reset()
    picture = world.reset(seed)
    for step in range(world.longest):
        proposed = learner.see(picture, STEP_S * step)
        if not proposed.needs_help and proposed.action is not None:
            picture, is_over = world.step(proposed.action, proposed.point)
            if is_over:
                break
    learner.reset()
    return world.score
