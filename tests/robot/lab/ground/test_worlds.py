"""The third-party worlds themselves: the scripted teachers reach their goals."""

from __future__ import annotations

import contextlib
import importlib.util

import numpy as np
import pytest

from robot.errors import ConfigurationError
from robot.lab.ground.run import run_ground
from robot.lab.ground.worlds import WORLDS, make_world
from tests.kit.sizes import IS_FULL

CARS = [name for name in WORLDS if name.startswith("CarRacing")]
LIBRARY = {"ViZDoom": "vizdoom", **dict.fromkeys(CARS, "Box2D")}
GOOD = {"YMaze": 0.0, "ViZDoom": 1900.0, **dict.fromkeys(CARS, 25.0)}
"""The least score of a teacher's drives, by world; in a maze a teacher may lose its way."""

pytestmark = [pytest.mark.filterwarnings("ignore"), pytest.mark.slow]


@pytest.fixture(params=sorted(WORLDS) if IS_FULL else ["CarRacing", "Hallway", "ViZDoom", "YMaze"])
def name(request: pytest.FixtureRequest) -> str:
    for library in ("gymnasium", LIBRARY.get(request.param, "miniworld")):
        if importlib.util.find_spec(library) is None:
            pytest.skip(f"NOT TESTED: {library} is not installed (the extra ground)")
    return str(request.param)


def test_the_teacher_reaches_the_goal_and_a_seed_repeats_its_episode(name: str) -> None:
    with contextlib.closing(make_world(name)) as world:
        first = world.reset(11)
        assert first.dtype == np.uint8 and first.ndim == 3 and first.shape[2] == 3
        assert (world.reset(11) == first).all()
        assert (world.reset(12) != first).any()
        is_over, n = False, 0
        while not is_over:
            _, is_over = world.step(world.wanted(), world.point)
            n += 1
        assert n <= world.longest
        assert world.score >= GOOD.get(name, 1.0)


def test_a_run_reports_the_examples_and_the_result(name: str) -> None:
    if name.startswith("CarRacing") or name == "YMaze":
        pytest.skip("takes long, and differs from the others in nothing that is tested here")
    params = {"world": name, "way": "corrections", "seed": 3, "counts": [60], "drives": 1}
    (stage,) = run_ground({**params, "learner": "knn-1"})["stages"]
    assert 50 <= stage["examples"] <= 60
    assert len(stage["scores"]) == 1
    (stage,) = run_ground({**params, "learner": "teacher"})["stages"]
    assert stage["scores"][0] >= GOOD.get(name, 1.0)


def test_an_unknown_world_is_named() -> None:
    with pytest.raises(ConfigurationError, match="Sidewalk"):
        make_world("Sidewalc")
