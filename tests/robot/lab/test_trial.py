"""A whole simulated driving lesson, through the real loop."""

from __future__ import annotations

import pytest

from robot.lab.ideas import make_trial
from robot.lab.trial import FRAME_RATE_HZ
from robot.types import DrivenBy, Mode

pytest.importorskip("panda3d.core", reason="the simulator's renderer is not installed")

BOX = {
    "world": "box",
    "moves": ("forward", "left"),
    "teacher": "usual",
    "learner": "published-8",
    "seed": 1,
}


def test_the_pilot_teaches_and_then_the_robot_drives_and_learns_nothing_unsupervised() -> None:
    """That the same seed gives the same numbers is tested in `test_runner`."""
    with make_trial(BOX) as trial:
        taught = trial.drive(Mode.TRAIN, 12.0)
        n_taught = sum(trial.loop.state.taught.values())
        lessons = trial.loop.history.taught.total()
        alone = trial.drive(Mode.AUTONOMOUS, 10.0, supervised=False)
        assert trial.loop.history.taught.total() == lessons
        assert trial.policy.n_nodes == 8
    assert len(taught) == 12 * FRAME_RATE_HZ
    assert {moment.driven_by for moment in taught[5:]} == {DrivenBy.PILOT}
    assert n_taught >= 100
    assert {moment.driven_by for moment in alone} == {DrivenBy.ROBOT}
