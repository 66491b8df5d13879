"""A whole simulated driving lesson, through the real loop."""

from __future__ import annotations

import pytest

from robot.lab.ideas import make_trial
from robot.lab.metrics import DriveLog
from robot.lab.trial import FRAME_RATE_HZ, Trial
from robot.types import DrivenBy, Mode

pytest.importorskip("panda3d.core", reason="the simulator's renderer is not installed")

BOX = {
    "world": "box",
    "moves": ("forward", "left"),
    "teacher": "usual",
    "learner": "published-8",
}


def lesson(seed: int) -> tuple[DriveLog, DriveLog, Trial]:
    with make_trial({**BOX, "seed": seed}) as trial:
        return trial.drive(Mode.TRAIN, 12.0), trial.drive(Mode.AUTONOMOUS, 8.0), trial


def test_the_same_seed_gives_the_same_numbers_to_the_last_digit() -> None:
    first, second = lesson(3), lesson(3)
    assert first[0] == second[0]
    assert first[1] == second[1]
    assert first[0] != lesson(4)[0]


def test_the_pilot_teaches_and_then_the_robot_drives() -> None:
    taught, alone, trial = lesson(1)
    assert len(taught) == 12 * FRAME_RATE_HZ
    assert {moment.driven_by for moment in taught[5:]} == {DrivenBy.PILOT}
    assert sum(trial.loop.state.taught.values()) >= 100
    assert DrivenBy.ROBOT in {moment.driven_by for moment in alone}
    assert trial.policy.n_nodes == 8


def test_unsupervised_nobody_takes_the_wheel_and_nothing_is_learned() -> None:
    with make_trial({**BOX, "seed": 0}) as trial:
        trial.drive(Mode.TRAIN, 6.0)
        lessons = trial.loop.history.n_examples
        alone = trial.drive(Mode.AUTONOMOUS, 10.0, supervised=False)
        assert trial.loop.history.n_examples == lessons
    assert {moment.driven_by for moment in alone} == {DrivenBy.ROBOT}
