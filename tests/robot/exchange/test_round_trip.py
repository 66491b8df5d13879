"""Driving in the simulator, export, import and learning give the same nodes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robot.exchange.folder import write_folder
from robot.exchange.tub import write_tub
from robot.learner.base import State
from robot.policy.registry import make_policy
from robot.recordings.edits import Notes
from robot.recordings.episode import Episode, open_episode
from robot.recordings.teaching import learn_again
from robot.store.models.model import same_nodes

from .imported import import_from
from .sim_drive import Driven, drive_in_simulator


@pytest.fixture(scope="module", params=["published-32", "default-32"])
def driven(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Driven:
    return drive_in_simulator(tmp_path_factory.mktemp("sim"), request.param, undo_s=1.0)


def learned(episode: Episode, learner: str) -> State:
    policy = make_policy(learner, episode.moves)
    learn_again(policy, [(episode, Notes())])
    return policy.get_state()


def test_through_a_tub_and_back_the_nodes_are_the_same(driven: Driven, tmp_path: Path) -> None:
    episode = open_episode(driven.path)
    assert driven.lessons > 80
    assert write_tub(episode, Notes(), tmp_path / "tub") == driven.lessons
    back = import_from(tmp_path / "tub", tmp_path / "back.mcap")
    assert back.run["source"] == "donkeycar tub v2"
    assert same_nodes(learned(back, episode.run["learner"]), driven.state)


def test_through_a_folder_and_back_nodes_and_times_are_the_same(
    driven: Driven, tmp_path: Path
) -> None:
    episode = open_episode(driven.path)
    write_folder(episode, Notes(), tmp_path / "folder")
    back = import_from(tmp_path / "folder", tmp_path / "back.mcap")
    gaps = [np.diff([f.captured_s for f in e.frames.values()]) for e in (episode, back)]
    assert np.allclose(*gaps, atol=2e-6)
    assert same_nodes(learned(back, episode.run["learner"]), driven.state)
