"""Environments as other people write them: each is driven, or refused with one true sentence.

`DRIVELESSON_WORLDS=300` tests 300 of them; each has a seed, which a failure names.
"""

from __future__ import annotations

import logging
import os
import re
from typing import Any

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="NOT TESTED: Gymnasium is not installed")

import gymnasium

from robot.bodies.gymnasium.actions import moves_of
from robot.bodies.gymnasium.camera import GymnasiumCamera, GymnasiumCameraOptions
from robot.bodies.gymnasium.driver import OVER_S, GymnasiumDriver, GymnasiumOptions
from robot.bodies.gymnasium.pictures import describe, picture_in
from robot.devices.rig import Rig
from robot.errors import ConfigurationError, RobotError
from robot.policy.image import to_rgb
from robot.policy.registry import make_policy
from robot.testing import VirtualClock
from robot.types import Frame, Mode
from tests.server.virtual_server import VirtualServer
from tests.standins.odd_environments import ACTIONS, BANDS, FORMS, NO_PICTURES, REWARDS, Odd, truth

WORLDS = int(os.environ.get("DRIVELESSON_WORLDS", "8"))
ODD = "tests.standins.odd_environments:Odd"


@pytest.mark.parametrize("seed", range(WORLDS))
def test_an_odd_environment_is_driven_or_refused_in_one_sentence(
    seed: int, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    clock = VirtualClock(100.0)
    monkeypatch.setattr(Odd, "compute", lambda _, seconds: clock.sleep(seconds))
    try:
        body = GymnasiumDriver(GymnasiumOptions(env=ODD, env_options=f"seed={seed}"))
        body.picture()
        body.close()
        camera = GymnasiumCamera(body, GymnasiumCameraOptions(), clock)
        with VirtualServer(
            rig=Rig(body, camera, make_policy("knn-1", body.moves), clock)
        ) as server:
            _drive(server, body)
    except RobotError as error:
        assert Odd.newest.wanted and Odd.newest.wanted in str(error), str(error)
        assert "\n" not in str(error) and len(str(error)) < 600
    else:
        assert not Odd.newest.wanted
    assert not [one for one in caplog.records if one.levelno >= logging.ERROR]


@pytest.mark.parametrize("form", FORMS)
def test_a_picture_in_any_form_is_upright_and_has_its_colours(form: str) -> None:
    picture = truth(48, 72)
    seen, space = FORMS[form](picture)
    for one in (picture_in(seen, space), picture_in(seen)):
        assert one is not None and one.dtype == np.uint8
        _check_pixels(one, has_colours="grey" not in form)


@pytest.mark.parametrize("form", NO_PICTURES)
def test_what_is_no_picture_is_said_in_words(form: str) -> None:
    assert picture_in(NO_PICTURES[form]) is None
    assert 0 < len(describe(NO_PICTURES[form])) < 100


@pytest.mark.parametrize("form", ACTIONS)
def test_any_action_can_be_given_by_itself_and_in_a_table(form: str) -> None:
    env = gymnasium.Env[Any, Any]()
    env.action_space = space = ACTIONS[form]()
    moves = moves_of("any", env)
    names = [move.name for move in moves]
    assert len(set(names)) == len(names) >= 2
    assert all(space.contains(action) for action in moves.values())
    with pytest.raises(ConfigurationError) as refused:
        moves_of("any", env, "left=9999,9999,9999,9999,9999,9999,9999,9999,9999; right=0")
    example = re.search(r"--env-moves '(.*)'", str(refused.value))
    assert example is not None, str(refused.value)
    from_example = moves_of("any", env, example[1])
    assert [move.name for move in from_example] == ["left", "right"]
    assert all(space.contains(action) for action in from_example.values())


def _drive(server: VirtualServer, body: GymnasiumDriver) -> None:
    """Teach three moves, see the end of a game, and let the robot drive."""
    env, loop = Odd.newest, server.rig.loop
    longest_s = 0.1 + env.takes_s
    assert not env.wanted, f"it drives, but should say {env.wanted!r}"
    pilot = server.pilot()
    _check_picture(server.rig.camera.latest(), env)
    pilot.mode("train")
    for move in body.moves[:3]:
        pilot.hold(move)
        server.forward(4 * longest_s)
    states = []
    unsubscribe = loop.subscribe(lambda tick: states.append(tick.sensors.game))
    server.forward(env.longest * longest_s + OVER_S + 2 * longest_s)
    unsubscribe()
    ended = [game for game in states if game is not None and game.is_over]
    assert ended and ended[0].reward == pytest.approx(REWARDS[env.reward_form][1])
    assert max(game.number for game in states if game is not None) >= 2, "the next game began"
    assert all(loop.state.taught[move] for move in body.moves[:3])
    pilot.hold(None)
    pilot.mode("autonomous")
    n_acts = len(env.acts)
    server.forward(6 * longest_s + OVER_S)
    assert loop.state.decision.mode is Mode.AUTONOMOUS and loop.state.stops == {}
    assert loop.state.fault is None and len(env.acts) > n_acts
    pilot.close()


def _check_picture(frame: Frame | None, env: Odd) -> None:
    """Check that the picture is upright and bright, and has the right colours."""
    assert frame is not None
    picture = to_rgb(frame).astype(float)
    assert picture.shape[:2] == env.size, env.form
    _check_pixels(picture, has_colours=env.has_colours)


def _check_pixels(picture: Any, *, has_colours: bool) -> None:
    height, width = picture.shape[:2]
    assert picture[: height // 8].mean() > 225
    for i, colour in enumerate(BANDS):
        middle = (2 * i + 1) * width // 6
        found = picture[height // 2 :, middle - 1 : middle + 2].mean(axis=(0, 1))
        wanted = np.array(colour, float)
        if not has_colours:
            wanted[:] = wanted @ [0.299, 0.587, 0.114]
        assert np.abs(found - wanted).max() < 40, (found, wanted)
