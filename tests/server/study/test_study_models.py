"""A trial is driven where it belongs, and one that is left leaves nothing behind."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from robot.devices.simulation.driver import SimDriver, SimOptions
from robot.devices.simulation.world import world_names
from robot.errors import ConfigurationError
from robot.lab.protocol import TRIALS
from server.study.lesson import check_world
from tests.server.test_teaching_routes import _teach, ask
from tests.server.virtual_server import VirtualServer


@pytest.mark.parametrize(("world", "trial"), list(itertools.product(world_names(), TRIALS)))
def test_a_trial_in_another_world_is_refused_with_a_sentence(world: str, trial: int) -> None:
    body = SimDriver(SimOptions(world=world))
    if world == TRIALS[trial][0]:
        check_world(body, trial)
        return
    with pytest.raises(ConfigurationError, match=f"--world {TRIALS[trial][0]}") as refused:
        check_world(body, trial)
    assert repr(world) in str(refused.value)


def test_of_a_real_robot_the_place_is_not_known() -> None:
    check_world(object(), 1)


@pytest.mark.parametrize("knows", [0, 40])
def test_a_trial_that_is_left_leaves_no_model(tmp_path: Path, knows: int) -> None:
    with VirtualServer(data=tmp_path) as server:
        if knows:
            _teach(server, knows)
            ask(server, "POST", "/api/models/save", json={})
        before = ask(server, "GET", "/api/models").json()
        moves = server.rig.loop.state.moves
        begun = ask(server, "POST", "/api/lesson", json={"trial": 1, "teach_s": 90})
        assert begun.status_code == 201, begun.text
        assert ask(server, "GET", "/api/teaching").json()["lessons"] == 0
        ask(server, "DELETE", "/api/lesson")
        after = ask(server, "GET", "/api/models").json()
        names = {model["name"] for model in after["models"]}
        assert "Trial 1" not in names
        assert {model["name"] for model in before["models"]} == names
        assert ask(server, "GET", "/api/teaching").json()["lessons"] == knows
        assert server.rig.loop.history.policy.moves == moves
