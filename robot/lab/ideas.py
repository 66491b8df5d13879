"""Makes learners, teachers and trials by name. The name may be built in, be an entry point of an
installed package, or have the form `path.py:Name`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from importlib.machinery import SourceFileLoader
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from robot.errors import ConfigurationError
from robot.lab.simulated_pilots.behaviours import Follower, Pusher, WallFollower
from robot.lab.simulated_pilots.hand import PRACTISED, STEADY
from robot.lab.simulated_pilots.pilot import SimulatedPilot
from robot.lab.simulated_pilots.teachers import TEACHER_PARAMS, SonarController, Teacher, Wanderer
from robot.lab.task import Params
from robot.lab.trial import Trial
from robot.learner.base import Learner
from robot.policy.features import GradientFeatures
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.types import Action

_TEACHERS: dict[str, Callable[[tuple[Action, ...]], Teacher]] = {
    "sonar": lambda turns: SonarController(),
    "wall": lambda turns: WallFollower(),
    "follow": lambda turns: Follower(),
    "push": lambda turns: Pusher(),
    **{name: partial(Wanderer, params=params) for name, params in TEACHER_PARAMS.items()},
}


def make_learner(name: str, moves: tuple[Action, ...]) -> Policy:
    """Return a policy.

    Args:
        name: A built-in name such as `default-32`, the name of an entry point, or `path.py:Name`: a
            class or function that, called without arguments, returns a `Policy` or a `Learner`. A
            `Learner` gets the features and the action filter of the default learner.
        moves: The moves that the policy may propose.

    Raises:
        ConfigurationError: If the name is unknown, or the call returns neither a `Policy` nor a
            `Learner`. The error names the file and the reason.
    """
    made = _make_idea(name, "drivelesson.learners")
    if made is None:
        return make_policy(name, moves=moves)
    if isinstance(made, Policy):
        made.moves = moves
        return made
    if isinstance(made, Learner):
        return Policy(name, 0, made, GradientFeatures(), moves=moves)
    raise ConfigurationError(
        f"{name} returned a {type(made).__name__}, which is neither a Policy nor a Learner"
    )


def make_teacher(name: str, moves: tuple[Action, ...]) -> Teacher:
    """Return a teacher by its name: a built-in teacher such as `sonar`, an entry point, or
    `path.py:Name`. Raises ConfigurationError if the name is unknown or does not name a teacher."""
    made = _make_idea(name, "drivelesson.teachers")
    if made is not None:
        if not (hasattr(made, "choose") and hasattr(made, "tolerates")):
            raise ConfigurationError(
                f"{name} is not a teacher: a teacher needs the methods `choose` and `tolerates`"
            )
        return made  # type: ignore[no-any-return]
    if name not in _TEACHERS:
        known = ", ".join(_TEACHERS)
        raise ConfigurationError(f"unknown teacher {name!r}; choose {known}, or path.py:Name")
    return _TEACHERS[name](tuple(move for move in moves if move is not Action.FORWARD))


def make_trial(params: Params) -> Trial:
    """Build a trial of `world`, `learner`, `teacher`, `moves` and `seed`.

    The teacher `sonar` stands for a program on the robot, so it has no human delays.
    """
    moves, seed = tuple(map(Action, params["moves"])), params["seed"]
    teacher = make_teacher(params["teacher"], moves)
    hand = STEADY if params["teacher"] == "sonar" else PRACTISED
    pilot = SimulatedPilot(teacher, moves, hand=hand, seed=str(seed))
    return Trial(params["world"], seed, make_learner(params["learner"], moves), pilot)


def _make_idea(name: str, group: str) -> Any:
    """Return the object made by an entry point or a file; None for a built-in name."""
    file, colon, attribute = name.rpartition(":")
    try:
        for point in entry_points(group=group, name=name):
            return point.load()()
        if colon and file.endswith(".py"):
            return getattr(_load_file(Path(file)), attribute)()
    except Exception as error:  # a user's own file may raise any error
        raise ConfigurationError(
            f"{name} cannot be used: {type(error).__name__}: {error}"
        ) from error
    return None


def _load_file(path: Path) -> ModuleType:
    if not path.is_file():
        raise FileNotFoundError(f"there is no file {path}")
    loader = SourceFileLoader(f"drivelesson_idea_{path.stem}", str(path))
    module = sys.modules[loader.name] = ModuleType(loader.name)
    module.__file__ = str(path)
    loader.exec_module(module)
    return module
