"""A trial is driven only in its world, and a trial that is left leaves nothing behind."""

from __future__ import annotations

import itertools
import json
import shutil
from pathlib import Path

import pytest

from robot.errors import ConfigurationError
from robot.simulator import world
from robot.simulator.driver import SimDriver, SimOptions
from robot.simulator.world import world_names
from robot.study.builtin import TRIALS, trial_plan
from robot.study.plan import Condition, parse_plan
from robot.testing import FakeDriver
from server.study.conductor import check_body


def condition(trial: int) -> Condition:
    return parse_plan(trial_plan(trial, 90)).conditions[0]


@pytest.mark.parametrize(("world", "trial"), list(itertools.product(world_names(), TRIALS)))
def test_a_trial_in_another_world_is_refused_with_a_sentence(world: str, trial: int) -> None:
    body = SimDriver(SimOptions(world=world))
    if world == TRIALS[trial][0]:
        check_body(body, condition(trial))
        return
    with pytest.raises(
        ConfigurationError, match=f"choose {TRIALS[trial][0]!r} under Settings"
    ) as refused:
        check_body(body, condition(trial))
    assert repr(world) in str(refused.value)


def test_a_world_that_is_only_a_file_is_known_by_its_file_and_by_its_name(tmp_path: Path) -> None:
    file = tmp_path / "room.toml"
    shutil.copy(Path(world.__file__).parent / "worlds" / "box.toml", file)
    (tmp_path / "other").mkdir()
    here, elsewhere = SimDriver(SimOptions(world=str(file))), SimDriver(SimOptions())

    def driven_in(place: str) -> Condition:
        text = trial_plan(1, 90).replace('world = "box"', f"world = {json.dumps(place)}")
        return parse_plan(text).conditions[0]

    for place in ("room", str(file), str(tmp_path / "other" / ".." / "room.toml")):
        check_body(here, driven_in(place))
        with pytest.raises(ConfigurationError, match="start the robot with --world and its TOML"):
            check_body(elsewhere, driven_in(place))
    for place in ("roam", str(tmp_path / "other" / "room.toml")):
        with pytest.raises(ConfigurationError, match="this place is not offered under Settings"):
            check_body(here, driven_in(place))
    here.enter("office")
    here.advance(0.1)
    with pytest.raises(ConfigurationError, match="choose 'room' under Settings, Place"):
        check_body(here, driven_in(str(file)))


def test_the_place_of_a_real_robot_is_unknown() -> None:
    check_body(FakeDriver(), condition(1))
