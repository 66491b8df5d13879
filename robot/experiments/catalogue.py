"""All experiments by name."""

from __future__ import annotations

from robot.experiments.ablation import Ablation
from robot.experiments.behaviours import Behaviours, MoreMoves
from robot.experiments.delay import Delay
from robot.experiments.experiment import Experiment
from robot.experiments.figure3 import Figure3
from robot.experiments.figure5 import Figure5
from robot.experiments.figure6 import Figure6
from robot.experiments.figure7 import Figure7
from robot.experiments.figure8 import Figure8
from robot.experiments.habits import Habits
from robot.experiments.mind import Mind
from robot.experiments.ready import Ready

EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        *(Figure3(), Figure5(), Figure6(), Figure7(), Figure8()),
        *(Delay(), MoreMoves(), Behaviours(), Ablation(), Habits(), Ready(), Mind()),
    )
}
"""In the order in which `all` runs them."""

ALONE = frozenset({Figure5.name})
"""Experiments that time the machine: their runs are made one after the other, here."""
