"""All experiments by name."""

from __future__ import annotations

from robot.lab.behaviours import Behaviours
from robot.lab.experiment import Experiment
from robot.lab.figure3 import Figure3
from robot.lab.figure5 import Figure5
from robot.lab.ground.ground import Ground
from robot.lab.habits import Habits
from robot.lab.lessons import ABLATION, DELAY, FIGURE6, FIGURE7, FIGURE8, MOVES
from robot.lab.mind import Mind
from robot.lab.ready import Ready
from robot.lab.streams import Streams

EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        *(Figure3(), Figure5(), FIGURE6, FIGURE7, FIGURE8),
        *(DELAY, MOVES, Behaviours(), ABLATION, Habits(), Ready(), Mind(), Ground(), Streams()),
    )
}
"""In the order in which `all` runs them."""

ALONE = frozenset({Figure5.name})
"""Experiments that time the machine: their runs are made one after the other, here."""
