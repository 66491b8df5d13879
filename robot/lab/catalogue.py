"""All experiments by name."""

from __future__ import annotations

from robot.lab.ablation import ABLATION
from robot.lab.behaviours import BEHAVIOURS
from robot.lab.by_degrees import BY_DEGREES
from robot.lab.experiment import Experiment
from robot.lab.figure3 import FIGURE3
from robot.lab.figure5 import FIGURE5
from robot.lab.ground.ground import GROUND
from robot.lab.habits import GATE
from robot.lab.lessons import FIGURE6, FIGURE7, FIGURE8
from robot.lab.mind import MIND
from robot.lab.ready import READY
from robot.lab.streams import ONLINE

EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        *(FIGURE3, FIGURE5, FIGURE6, FIGURE7, FIGURE8),
        *(BEHAVIOURS, ABLATION, GATE, READY, MIND, BY_DEGREES, GROUND, ONLINE),
    )
}
"""In the order in which `all` runs them."""
