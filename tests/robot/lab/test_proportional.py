"""The experiment on proportional steering, and its measure of smoothness."""

from __future__ import annotations

from unittest import mock

import numpy as np
import pytest

from robot.lab import proportional
from robot.lab.experiment import ExperimentSettings
from robot.lab.metrics import steering_per_s
from robot.lab.task import Task


def test_steering_that_changes_more_counts_as_rougher() -> None:
    times = np.arange(11) / 10
    assert steering_per_s(np.linspace(0.0, 1.0, 11), times) == pytest.approx(1.0)
    assert steering_per_s([0.0] * 5 + [1.0] * 6, times) == pytest.approx(np.sqrt(10.0))
    assert steering_per_s([0.3], [0.0]) == 0.0


def test_a_proportional_pilot_is_smoother_than_one_reduced_to_moves() -> None:
    plan = list(proportional.PROPORTIONAL.plan(ExperimentSettings(quick=True)))
    assert [task.params["way"] for task in plan] == list(proportional.WAYS)
    short = {"TEACH_S": 20.0, "CORRECT_S": 1.0, "ALONE_S": 3.0, "_MINUTES": 1}
    with mock.patch.multiple(proportional, **short):
        runs = [(Task(task.run, task.params), task.run(task.params)) for task in plan[:2]]
    degrees, cut = (result["teacher"]["steering_per_s"] for _, result in runs)
    assert 0.0 < degrees < 0.5 * cut
    for table in proportional.PROPORTIONAL.tables(runs):
        assert [row[0] for row in table.rows] == ["degrees", "cut to moves"]
        assert {len(row) for row in table.rows} == {len(table.columns)}
