"""Environments as other people write them: each is driven, or refused with one true sentence."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="NOT TESTED: Gymnasium is not installed")

import gymnasium

from robot.bodies.gymnasium.actions import moves_of
from robot.bodies.gymnasium.environment import Environment
from robot.bodies.gymnasium.pictures import describe, picture_in
from robot.errors import ConfigurationError
from tests.kit.sizes import crossed
from tests.standins.odd_environments import (
    ACTIONS,
    BANDS,
    BEHAVIOURS,
    FORMS,
    NO_PICTURES,
    REWARDS,
    UNDRIVABLE,
    truth,
)

ODD = "tests.standins.odd_environments:Odd"


@crossed(behaviour=BEHAVIOURS, reward=REWARDS)
def test_games_are_played_whatever_form_their_rewards_and_ends_have(
    behaviour: str, reward: str
) -> None:
    env = Environment(ODD, {"behaviour": behaviour, "reward": reward}, "auto", 1)
    for number in (1, 2):
        env.reset()
        assert (env.game.number, env.game.is_over) == (number, False)
        for _ in range(3):
            assert not env.game.is_over
            env.step(1)
            assert env.game.reward == pytest.approx(REWARDS[reward][1])
        assert env.game.is_over and env.game.score == pytest.approx(
            np.clip(3 * REWARDS[reward][1], -1e12, 1e12)
        )
        assert np.array_equal(env.picture(), truth(120, 160))


@pytest.mark.parametrize("form", UNDRIVABLE)
def test_what_a_thumb_cannot_drive_is_refused_in_one_sentence(form: str) -> None:
    make, says = UNDRIVABLE[form]
    env = gymnasium.Env[Any, Any]()
    env.action_space = make()
    with pytest.raises(ConfigurationError, match=says) as refused:
        moves_of("any", env)
    assert "\n" not in str(refused.value) and len(str(refused.value)) < 600


@pytest.mark.parametrize("form", FORMS)
def test_a_picture_in_any_form_is_upright_and_has_its_colours(form: str) -> None:
    seen, space = FORMS[form](truth(48, 72))
    for one in (picture_in(seen, space), picture_in(seen)):
        assert one is not None and one.dtype == np.uint8
        height, width = one.shape[:2]
        assert one[: height // 8].mean() > 225
        for i, colour in enumerate(BANDS):
            middle = (2 * i + 1) * width // 6
            found = one[height // 2 :, middle - 1 : middle + 2].mean(axis=(0, 1))
            wanted = np.array(colour, float)
            if "grey" in form:
                wanted[:] = wanted @ [0.299, 0.587, 0.114]
            assert np.abs(found - wanted).max() < 40, (found, wanted)


@pytest.mark.parametrize("form", NO_PICTURES)
def test_an_observation_that_is_no_picture_is_reported_in_words(form: str) -> None:
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
